//! Histograms of half vectors in slope space, where a lobe looks the same at every roughness.
//!
//! A slope is divided by α and squeezed, t = s/√(1 + s²), so that equal cells over |t| ≤ 0.98 follow the lobe from its
//! peak to s = 4.9; what lies beyond, or was not drawn at all, is one more cell.

use super::chi2;
use opsr::bsdf::Bsdf;
use opsr::math::{DVec3, Vec3};
use rand::RngExt;
use rand_pcg::Pcg32;

/// Cells along one side.
const N: usize = 10;
const END: f64 = 0.98;

/// The test of one closure, seen from one direction, at one roughness.
pub(crate) struct View {
    pub(crate) bsdf: Bsdf,
    pub(crate) alpha: f32,
    pub(crate) wo: Vec3,
    /// Relative index of refraction across the surface, from `wo`'s side; 0 for a wall that does not refract.
    pub(crate) eta: f64,
}

impl View {
    fn side(&self) -> f64 {
        f64::from(self.wo.z.signum())
    }

    /// `wo` in double precision, from above.
    fn wo(&self) -> DVec3 {
        self.wo.as_dvec3().normalize() * self.side()
    }

    /// Density of the closure per steradian, in double precision from the pair's query.
    fn pdf(&self, wi: DVec3) -> f64 {
        let wi = (wi * self.side()).as_vec3();
        self.bsdf.query(self.wo, wi).map_or(0.0, |q| {
            f64::from(q.base_pdf) + f64::from(q.pdf_scale) * q.shape(f64::from(self.alpha)).dg1
        })
    }

    /// The cell of a drawn direction; the last one for what is outside.
    fn cell(&self, wi: Vec3) -> usize {
        let wi = wi.as_dvec3().normalize() * self.side();
        let through = wi.z < 0.0;
        let h = match (through, self.eta) {
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

    /// Direction for a half vector of squeezed slopes (`x`, `y`), and dω_i / d(x, y).
    fn direction(&self, through: bool, x: f64, y: f64) -> Option<(DVec3, f64)> {
        let alpha = f64::from(self.alpha);
        let slope = |t: f64| t / (1.0 - t * t).sqrt() * alpha;
        let m = DVec3::new(slope(x), slope(y), 1.0).normalize();
        let wo = self.wo();
        let om = wo.dot(m);
        if om <= 0.0 {
            return None;
        }
        // dω_m = cos³ θ_m ds², and the squeeze's own derivative.
        let squeeze = |t: f64| alpha / ((1.0 - t * t) * (1.0 - t * t).sqrt());
        let domega_m = m.z * m.z * m.z * squeeze(x) * squeeze(y);
        let mirrored = 2.0 * om * m - wo;
        match (through, self.eta) {
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

    /// What `count` draws are expected to give in each cell.
    fn expected(&self, count: u32) -> Vec<f64> {
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
                count * chi2::integrate(&f, x, y, 0.2 / count)
            })
            .collect();
        let rest = count - cells.iter().sum::<f64>();
        assert!(
            rest > -1e-3 * count,
            "the density of {:?} at {} integrates to {}",
            self.bsdf,
            self.alpha,
            1.0 - rest / count
        );
        cells.push(rest.max(0.0));
        cells
    }

    /// P-value of `count` draws of the closure itself.
    pub(crate) fn test_itself(&self, count: u32, rng: &mut Pcg32) -> f64 {
        self.test(count, || {
            let u = std::array::from_fn(|_| rng.random());
            self.bsdf.sample(self.alpha, self.wo, u).map(|s| s.wi)
        })
    }

    /// P-value of `count` draws by `draw` against the density of this view.
    pub(crate) fn test(&self, count: u32, mut draw: impl FnMut() -> Option<Vec3>) -> f64 {
        let mut observed = vec![0; 2 * N * N + 1];
        for _ in 0..count {
            observed[draw().map_or(2 * N * N, |wi| self.cell(wi))] += 1;
        }
        chi2::p_value(&observed, &self.expected(count))
    }
}
