//! (to come)

/// Which microfacet slope distribution a glossy lobe has.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
#[repr(u8)]
pub enum Distribution {
    /// Gaussian slopes: what the tables are learned for.
    #[default]
    Beckmann,
    /// Trowbridge-Reitz, glTF's own model.
    Ggx,
}
