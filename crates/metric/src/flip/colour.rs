//! Colour spaces of FLIP: linear sRGB, the opponent space YCxCz, CIELAB, and the distance between colours.

use std::sync::LazyLock;

use glam::{DMat3, DVec3};

/// Linear sRGB to CIE XYZ, from the primaries of Rec. 709 and white D65; rows X, Y, Z.
const RGB_TO_XYZ: [[f64; 3]; 3] = [
    [
        10_135_552.0 / 24_577_794.0,
        8_788_810.0 / 24_577_794.0,
        4_435_075.0 / 24_577_794.0,
    ],
    [
        2_613_072.0 / 12_288_897.0,
        8_788_810.0 / 12_288_897.0,
        887_015.0 / 12_288_897.0,
    ],
    [
        1_425_312.0 / 73_733_382.0,
        8_788_810.0 / 73_733_382.0,
        70_074_185.0 / 73_733_382.0,
    ],
];

struct Matrices {
    /// Linear sRGB to XYZ relative to white.
    to_xyz: DMat3,
    /// The inverse.
    to_rgb: DMat3,
}

static MATRICES: LazyLock<Matrices> = LazyLock::new(|| {
    let to_xyz = DMat3::from_cols_array_2d(&RGB_TO_XYZ).transpose();
    let white = to_xyz * DVec3::ONE;
    let to_xyz = DMat3::from_diagonal(white.recip()) * to_xyz;
    Matrices {
        to_xyz,
        to_rgb: to_xyz.inverse(),
    }
});

/// Linear sRGB to YCxCz: a linear form of CIELAB, in which the eye's blur is applied.
pub(super) fn opponent(rgb: DVec3) -> DVec3 {
    let t = MATRICES.to_xyz * rgb;
    DVec3::new(116.0 * t.y - 16.0, 500.0 * (t.x - t.y), 200.0 * (t.y - t.z))
}

/// The inverse of [`opponent`].
pub(super) fn opponent_to_rgb(c: DVec3) -> DVec3 {
    let y = (c.x + 16.0) / 116.0;
    MATRICES.to_rgb * DVec3::new(y + c.y / 500.0, y, y - c.z / 200.0)
}

/// Linear sRGB to CIELAB, with the Hunt effect: dark colours have less chroma. [FLIP20 §4.1.3]
pub(super) fn hunt_lab(rgb: DVec3) -> DVec3 {
    const DELTA: f64 = 6.0 / 29.0;
    let f = |t: f64| {
        if t > DELTA * DELTA * DELTA {
            t.cbrt()
        } else {
            t / (3.0 * DELTA * DELTA) + 4.0 / 29.0
        }
    };
    let t = MATRICES.to_xyz * rgb;
    let (x, y, z) = (f(t.x), f(t.y), f(t.z));
    let lightness = 116.0 * y - 16.0;
    let hunt = 0.01 * lightness;
    DVec3::new(lightness, hunt * 500.0 * (x - y), hunt * 200.0 * (y - z))
}

/// CIELAB to linear sRGB; outside [0, 1] for colours outside the gamut.
pub(crate) fn lab_to_rgb(lab: DVec3) -> DVec3 {
    const DELTA: f64 = 6.0 / 29.0;
    let inverse = |f: f64| {
        if f > DELTA {
            f * f * f
        } else {
            3.0 * DELTA * DELTA * (f - 4.0 / 29.0)
        }
    };
    let y = (lab.x + 16.0) / 116.0;
    MATRICES.to_rgb
        * DVec3::new(
            inverse(y + lab.y / 500.0),
            inverse(y),
            inverse(y - lab.z / 200.0),
        )
}

/// HyAB: city-block in lightness, Euclidean in chroma. [FLIP20 §4.1.4]
pub(super) fn hyab(a: DVec3, b: DVec3) -> f64 {
    let d = a - b;
    d.x.abs() + d.y.hypot(d.z)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colour_spaces_round_trip() {
        assert!(
            (opponent(DVec3::ONE) - DVec3::new(100.0, 0.0, 0.0))
                .abs()
                .max_element()
                < 1e-9
        );
        assert!(
            (hunt_lab(DVec3::ONE) - DVec3::new(100.0, 0.0, 0.0))
                .abs()
                .max_element()
                < 1e-9
        );
        let c = DVec3::new(0.2, 0.7, 0.05);
        assert!((opponent_to_rgb(opponent(c)) - c).abs().max_element() < 1e-12);
        let hunt = hunt_lab(c);
        let lab = DVec3::new(hunt.x, hunt.y / (0.01 * hunt.x), hunt.z / (0.01 * hunt.x));
        assert!((lab_to_rgb(lab) - c).abs().max_element() < 1e-12);
    }
}
