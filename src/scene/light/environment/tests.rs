use super::*;

/// Directions are uniform per steradian inside each texel, with the density that `pdf` gives: radiance over density
/// is the same for every draw from a grey map. Chi-square over 3 x 8 parts of each texel, equal in solid angle.
#[test]
fn chi_square_of_samples_within_texels_up_to_the_poles() {
    const PARTS: [usize; 2] = [3, 8];
    let n = 400_000;
    for (w, h) in [(1, 1), (4, 2), (3, 3), (8, 4)] {
        let sky = |x: usize, y: usize| Rgb::splat(0.2 + ((7 * x + 3 * y) % 5) as f32);
        let sky = Environment::from_map(Buffer::from_fn(w, h, sky), 0.7);
        let total = 4.0 * PI * luminance(sky.average());
        let mut counts = vec![0u32; w * h * PARTS[0] * PARTS[1]];
        let mut weights = vec![0.0; counts.len()];
        for i in 0..n {
            // A rank-1 lattice with the square of the plastic number.
            let at = |step: f64| ((f64::from(i) + 0.5) * step).fract() as f32;
            let u = Vec2::new(at(0.754_877_666_246_69), at(0.569_840_290_998_05));
            let (dir, radiance, pdf) = sky.sample(u.as_dvec2()).expect("not black");
            assert!((luminance(radiance) / pdf / total - 1.0).abs() < 1e-4);
            assert!((dir.length() - 1.0).abs() < 1e-6);
            let place = sky.place(dir);
            let [x, y] = sky.texel(dir);
            // Rounding may put a draw into the next texel.
            let inside = (place * Vec2::new(w as f32, h as f32)).fract();
            let rim = inside.min_element().min(1.0 - inside.max_element());
            assert!(rim < 1e-4 || (sky.pdf(dir) / pdf - 1.0).abs() < 1e-4);
            let cos = |row: f64| (PI_F64 * row / h as f64).cos();
            let (top, bottom) = (cos(y as f64), cos(y as f64 + 1.0));
            let v = (top - f64::from(dir.y)) / (top - bottom);
            let part = |t: f64, n: usize| ((t * n as f64) as usize).min(n - 1);
            let (a, b) = (part(f64::from(inside.x), PARTS[0]), part(v, PARTS[1]));
            let cell = (y * PARTS[1] + b) * w * PARTS[0] + x * PARTS[0] + a;
            counts[cell] += 1;
            let share = sky.solid_angles[y] / (PARTS[0] * PARTS[1]) as f32;
            weights[cell] = f64::from(sky.radiance(dir).x * share / total);
        }
        let sum: f64 = weights.iter().sum();
        assert!((sum - 1.0).abs() < 1e-5, "{w} {h}: {sum}");
        // The lattice is more even than random numbers: the statistic stays far below its degrees of freedom.
        let statistic: f64 = counts
            .iter()
            .zip(&weights)
            .map(|(&o, &p)| {
                let expected = p * f64::from(n);
                (f64::from(o) - expected).powi(2) / expected
            })
            .sum();
        assert!(
            statistic < counts.len() as f64,
            "{w} {h}: {statistic} of {}",
            counts.len()
        );
    }
}
