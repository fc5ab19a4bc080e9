//! Chi-square test of a BSDF's sampling against its density, at any roughness.
//!
//! Sampled directions are counted by the microfacet slopes of their half vector, where a lobe has the same shape at
//! every roughness. A slope is divided by α and mapped by t = s/√(1 + s²): equal cells over |t| ≤ 0.98 resolve the lobe
//! from its peak to s = 4.9. Directions beyond, and failed samples, share one more cell.
//!
//! Sheen fibres are sampled uniformly over the hemisphere, so their cells divide height and azimuth: in half vectors
//! the jump of the density at the horizon would lie inside cells.

use super::chi_square;
use opsr::bsdf::Bsdf;
use opsr::math::{DVec3, Vec3};
use std::f64::consts::PI;

/// Cells along one axis.
const N: usize = 10;
const END: f64 = 0.98;

/// Test of `sample(alpha, wo, ..)` against `pdf(alpha, wo, ..)` for one BSDF.
pub struct DensityTest {
    /// The BSDF.
    pub bsdf: Bsdf,
    /// Roughness at which it is sampled, at least 1e-3.
    pub alpha: f32,
    /// Local direction of unit length, on either side.
    pub wo: Vec3,
}

impl DensityTest {
    /// Index of refraction of the far side over that of the side of `wo`; 0 for a BSDF that does not refract.
    fn eta(&self) -> f64 {
        let mut bsdf = self.bsdf;
        match bsdf.dielectric_mut() {
            Some(glass) if self.wo.z > 0.0 => glass.eta.into(),
            Some(glass) => f64::from(1.0 / glass.eta),
            None => 0.0,
        }
    }

    fn side(&self) -> f64 {
        f64::from(self.wo.z.signum())
    }

    /// `wo` in double precision, mirrored to the upper side if necessary.
    fn wo(&self) -> DVec3 {
        self.wo.as_dvec3().normalize() * self.side()
    }

    /// Density of the BSDF per steradian.
    fn pdf(&self, wi: DVec3) -> f64 {
        let wi = (wi * self.side()).as_vec3();
        self.bsdf.pdf(self.alpha, self.wo, wi).into()
    }

    /// True for a BSDF that is sampled uniformly over the hemisphere.
    fn is_even(&self) -> bool {
        matches!(self.bsdf, Bsdf::Sheen(_))
    }

    /// Cell of a sampled direction; the last cell for directions beyond the grid.
    fn cell(&self, wi: Vec3) -> usize {
        let wi = wi.as_dvec3().normalize() * self.side();
        let through = wi.z < 0.0;
        if self.is_even() && !through {
            let at = |share: f64| ((share * N as f64) as usize).min(N - 1);
            return at(0.5 * (wi.y.atan2(wi.x) / PI + 1.0)) * N + at(wi.z);
        }
        let h = match (through, self.eta()) {
            (false, _) => self.wo() + wi,
            (true, 0.0) => self.wo() + DVec3::new(wi.x, wi.y, -wi.z),
            (true, eta) => self.wo() + eta * wi,
        };
        let t = [h.x / h.z, h.y / h.z].map(|s| {
            let s = s / f64::from(self.alpha);
            let t = s / (1.0 + s * s).sqrt();
            (t / END + 1.0) * 0.5 * N as f64
        });
        if t.iter().all(|&t| t >= 0.0 && t < N as f64) {
            usize::from(through) * N * N + t[1] as usize * N + t[0] as usize
        } else {
            2 * N * N
        }
    }

    /// Direction for a half vector with mapped slopes (`x`, `y`), and dω_i / d(x, y).
    fn direction(&self, through: bool, x: f64, y: f64) -> Option<(DVec3, f64)> {
        if self.is_even() {
            let (z, (sin, cos)) = (0.5 * (x / END + 1.0), (PI * y / END).sin_cos());
            let flat = (1.0 - z * z).max(0.0).sqrt();
            let wi = DVec3::new(flat * cos, flat * sin, z);
            return (!through).then_some((wi, 0.5 * PI / (END * END)));
        }
        let alpha = f64::from(self.alpha);
        let slope = |t: f64| t / (1.0 - t * t).sqrt() * alpha;
        let m = DVec3::new(slope(x), slope(y), 1.0).normalize();
        let wo = self.wo();
        let om = wo.dot(m);
        if om <= 0.0 {
            return None;
        }
        // dω_m = cos³ θ_m ds², and ds/dt of the mapping.
        let ds_dt = |t: f64| alpha / ((1.0 - t * t) * (1.0 - t * t).sqrt());
        let domega_m = m.z * m.z * m.z * ds_dt(x) * ds_dt(y);
        let mirrored = 2.0 * om * m - wo;
        match (through, self.eta()) {
            (false, _) => (mirrored.z > 0.0).then_some((mirrored, 4.0 * om * domega_m)),
            (true, 0.0) => (mirrored.z > 0.0).then(|| {
                let wi = DVec3::new(mirrored.x, mirrored.y, -mirrored.z);
                (wi, 4.0 * om * domega_m)
            }),
            (true, eta) => {
                let sin2 = (1.0 - om * om) / (eta * eta);
                if sin2 >= 1.0 {
                    return None;
                }
                let im = -(1.0 - sin2).sqrt();
                let wi = (om / eta + im) * m - wo / eta;
                let jacobian = (om + eta * im).powi(2) / (eta * eta * im.abs());
                (wi.z < 0.0).then_some((wi, jacobian * domega_m))
            }
        }
    }

    /// Expected number of `count` samples in each cell; `None` if the density integrates to more than 1.
    fn expected(&self, count: u32) -> Option<Vec<f64>> {
        let edge = |i: usize| (i as f64 / N as f64 * 2.0 - 1.0) * END;
        let count = f64::from(count);
        let mut cells: Vec<f64> = (0..2 * N * N)
            .map(|i| {
                let (through, y, x) = (i / (N * N) == 1, i / N % N, i % N);
                let f = |x: f64, y: f64| {
                    self.direction(through, x, y)
                        .map_or(0.0, |(wi, jacobian)| self.pdf(wi) * jacobian)
                };
                let (x, y) = ([edge(x), edge(x + 1)], [edge(y), edge(y + 1)]);
                count * chi_square::integrate(&f, x, y, 0.2 / count)
            })
            .collect();
        let rest = count - cells.iter().sum::<f64>();
        cells.push(rest.max(0.0));
        (rest > -1e-3 * count).then_some(cells)
    }

    /// P-value of `count` samples of the BSDF by uniform numbers in [0, 1)³.
    pub fn p_value(&self, count: u32, mut numbers: impl FnMut() -> [f32; 3]) -> f64 {
        self.p_value_of(count, || {
            let sample = self.bsdf.sample(self.alpha, self.wo, numbers());
            sample.map(|s| s.wi)
        })
    }

    /// P-value of `count` samples by `draw` against the density of the BSDF; 0 if the density's integral exceeds 1.
    pub fn p_value_of(&self, count: u32, mut draw: impl FnMut() -> Option<Vec3>) -> f64 {
        let mut observed = vec![0; 2 * N * N + 1];
        for _ in 0..count {
            observed[draw().map_or(2 * N * N, |wi| self.cell(wi))] += 1;
        }
        let expected = self.expected(count);
        expected.map_or(0.0, |expected| chi_square::p_value(&observed, &expected))
    }
}
