//! Curves, as tubes of triangles: splines of control points, and files of hair.

use crate::build::shapes;
use opsr::math::{Vec3, Vec4};
use opsr::scene::Mesh;
use opsr::scene::load::error::{Result, fault};

/// Least and most segments of a span of a curve, and the angle in radians per segment.
const PIECES: [f32; 2] = [2.0, 24.0];
const MAX_BEND: f32 = 0.15;

/// Points of a spline, each with its parameter along the curve from 0 to 1. `basis` is `bezier` or `bspline`, of degree
/// 2 or 3. `None` if the number of control points does not fit `[PBRT4 §6.7]`.
pub(super) fn spline(points: &[Vec4], basis: &str, degree: usize) -> Option<Vec<(Vec4, f32)>> {
    // Control points from one span to the next.
    let step = if basis == "bezier" { degree } else { 1 };
    let further = points.len().checked_sub(degree + 1)?;
    if further % step != 0 {
        return None;
    }
    let spans = further / step + 1;
    let mut out = Vec::new();
    let at = |span: usize, t: f32| {
        let mut p = [Vec4::ZERO; 4];
        p[..=degree].copy_from_slice(&points[span * step..=span * step + degree]);
        let s = 1.0 - t;
        let middle = |x: f32| (3.0 * x.powi(3) - 6.0 * x * x + 4.0) / 6.0;
        let weights: [f32; 4] = match (basis, degree) {
            ("bezier", 2) => [s.powi(2), 2.0 * t * s, t * t, 0.0],
            ("bezier", _) => [s.powi(3), 3.0 * t * s * s, 3.0 * t * t * s, t.powi(3)],
            (_, 2) => [0.5 * s.powi(2), 0.5 + t * s, 0.5 * t * t, 0.0],
            _ => [s.powi(3) / 6.0, middle(t), middle(s), t.powi(3) / 6.0],
        };
        let place: Vec4 = p.iter().zip(weights).map(|(p, w)| *p * w).sum();
        let share = (span as f64 + f64::from(t)) / spans as f64;
        (place, share as f32)
    };
    for span in 0..spans {
        let control = &points[span * step..=span * step + degree];
        let bends = control.windows(3).map(|w| {
            let (a, b) = (w[1] - w[0], w[2] - w[1]);
            let angle = a.truncate().angle_between(b.truncate());
            if angle.is_finite() { angle } else { 0.0 }
        });
        let pieces = (bends.sum::<f32>() / MAX_BEND)
            .ceil()
            .clamp(PIECES[0], PIECES[1]) as usize;
        out.extend((0..pieces).map(|i| at(span, i as f32 / pieces as f32)));
    }
    out.push(at(spans - 1, 1.0));
    Some(out)
}

/// Tubes around the curves of a file of Mitsuba: lines of a position and a radius, a blank line after each curve.
/// `hair` as `plugin` has one `radius` and may be binary. `to_world` moves positions and does not scale radii.
pub(super) fn read(
    bytes: &[u8],
    plugin: &str,
    radius: f32,
    to_world: impl Fn(Vec3) -> Vec3,
    place: &str,
) -> Result<Mesh> {
    let mut curves = match bytes.strip_prefix(b"BINARY_HAIR") {
        Some(rest) => binary(rest, radius, place)?,
        None => lines(bytes, radius, place)?,
    };
    curves.retain(|curve| !curve.is_empty());
    if curves.is_empty() {
        return Err(fault(place, "has no curves"));
    }
    let points: usize = curves.iter().map(Vec::len).sum();
    let bytes = shapes::TUBE_BYTES * points as u64;
    opsr::memory::check(format!("{place}: {points} points of curves"), bytes)?;
    let mut mesh = Mesh::default();
    for (k, mut curve) in curves.into_iter().enumerate() {
        for p in &mut curve {
            *p = to_world(p.truncate()).extend(p.w);
        }
        let along = match plugin {
            "bsplinecurve" => spline(&curve, "bspline", 3),
            _ => (curve.len() > 1).then(|| curve.iter().map(|p| (*p, 0.0)).collect()),
        };
        let along = along.ok_or_else(|| {
            let what = format!("curve {k} has too few points, {}", curve.len());
            fault(place, what)
        })?;
        let tube: Vec<(Vec3, f32)> = along.iter().map(|(p, _)| (p.truncate(), p.w)).collect();
        if tube.iter().any(|(p, r)| !p.is_finite() || !r.is_finite()) {
            return Err(fault(place, format!("curve {k} is not finite")));
        }
        if tube.iter().any(|(_, r)| *r < 0.0) {
            return Err(fault(place, format!("curve {k} has a negative radius")));
        }
        shapes::append(&mut mesh, &shapes::tube(&tube));
    }
    Ok(mesh)
}

fn lines(bytes: &[u8], radius: f32, place: &str) -> Result<Vec<Vec<Vec4>>> {
    let (mut curves, mut curve) = (Vec::new(), Vec::new());
    for (n, line) in String::from_utf8_lossy(bytes).lines().enumerate() {
        let numbers: Option<Vec<f32>> = line.split_whitespace().map(|w| w.parse().ok()).collect();
        match numbers.as_deref() {
            Some([]) => curves.push(std::mem::take(&mut curve)),
            Some(&[x, y, z]) => curve.push(Vec4::new(x, y, z, radius)),
            Some(&[x, y, z, r]) => curve.push(Vec4::new(x, y, z, r)),
            _ => {
                let line = format!("{place}: line {}", n + 1);
                return Err(fault(line, "is no point of a curve"));
            }
        }
    }
    curves.push(curve);
    Ok(curves)
}

/// Hair of Mitsuba 0.6: the number of points, then three numbers each; an infinite one begins a strand.
fn binary(bytes: &[u8], radius: f32, place: &str) -> Result<Vec<Vec<Vec4>>> {
    let (words, rest) = bytes.as_chunks::<4>();
    let Some((count, numbers)) = words.split_first() else {
        return Err(fault(place, "ends before its points"));
    };
    let mut numbers = numbers.iter().map(|b| f32::from_le_bytes(*b));
    let (count, mut points) = (u32::from_le_bytes(*count), 0);
    let (mut curves, mut curve) = (Vec::new(), Vec::new());
    while let Some(mut x) = numbers.next() {
        if x.is_infinite() {
            curves.push(std::mem::take(&mut curve));
            x = numbers.next().unwrap_or(f32::NAN);
        }
        let (Some(y), Some(z)) = (numbers.next(), numbers.next()) else {
            return Err(fault(place, "ends within a point"));
        };
        points += 1;
        curve.push(Vec4::new(x, y, z, radius));
    }
    if points != count || !rest.is_empty() {
        let what = format!("has {points} points and says {count}");
        return Err(fault(place, what));
    }
    curves.push(curve);
    Ok(curves)
}
