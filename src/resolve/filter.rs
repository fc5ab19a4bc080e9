//! Means over the pixels around.

use std::collections::VecDeque;
use std::ops::{AddAssign, DivAssign};

/// Width and height.
pub(super) type Size = (usize, usize);

/// A box filter applied twice, in place: about a tent of radius 2 `radius`. At the border a mean over the pixels inside.
pub(super) fn tent<T>(size: Size, radius: usize, values: &mut [T])
where
    T: Copy + Default + AddAssign + DivAssign<f32>,
{
    boxed(size, radius, values);
    boxed(size, radius, values);
}

/// Mean over the square of radius `radius` around every pixel, in place.
fn boxed<T>((width, height): Size, radius: usize, values: &mut [T])
where
    T: Copy + Default + AddAssign + DivAssign<f32>,
{
    // The usual ones without a loop over what is around.
    match radius {
        1 if width.min(height) > 2 => boxed_over::<T, 3>((width, height), values),
        2 if width.min(height) > 4 => boxed_over::<T, 5>((width, height), values),
        3 if width.min(height) > 6 => boxed_over::<T, 7>((width, height), values),
        _ => boxed_any((width, height), radius, values),
    }
}

/// The same over squares of `N` pixels a side, an odd number, of pictures that are as large: the same bits.
fn boxed_over<T, const N: usize>((width, height): Size, values: &mut [T])
where
    T: Copy + Default + AddAssign + DivAssign<f32>,
{
    let radius = N / 2;
    let around = |at: usize, end: usize| at.saturating_sub(radius)..(at + radius + 1).min(end);
    let mut old = Vec::with_capacity(width);
    for row in values.chunks_exact_mut(width) {
        old.clear();
        old.extend_from_slice(row);
        for x in (0..radius).chain(width - radius..width) {
            row[x] = mean(&old[around(x, width)]);
        }
        for (out, near) in row[radius..].iter_mut().zip(old.array_windows::<N>()) {
            *out = mean(near);
        }
    }
    let old = values.to_vec();
    for (y, out) in values.chunks_exact_mut(width).enumerate() {
        let rows = around(y, height);
        if rows.len() == N {
            let near: [&[T]; N] =
                std::array::from_fn(|i| &old[(rows.start + i) * width..][..width]);
            for (x, out) in out.iter_mut().enumerate() {
                *out = mean(&near.map(|row| row[x]));
            }
            continue;
        }
        out.fill(T::default());
        let count = rows.len() as f32;
        for row in old[rows.start * width..rows.end * width].chunks_exact(width) {
            out.iter_mut().zip(row).for_each(|(sum, v)| *sum += *v);
        }
        out.iter_mut().for_each(|sum| *sum /= count);
    }
}

/// Their mean.
#[inline(always)]
fn mean<T>(values: &[T]) -> T
where
    T: Copy + Default + AddAssign + DivAssign<f32>,
{
    let mut mean = T::default();
    values.iter().for_each(|v| mean += *v);
    mean /= values.len() as f32;
    mean
}

/// The same for any radius.
fn boxed_any<T>((width, height): Size, radius: usize, values: &mut [T])
where
    T: Copy + Default + AddAssign + DivAssign<f32>,
{
    let around = |at: usize, end: usize| at.saturating_sub(radius)..(at + radius + 1).min(end);
    let mut old = Vec::new();
    for row in values.chunks_mut(width.max(1)) {
        old.clear();
        old.extend_from_slice(row);
        for (x, out) in row.iter_mut().enumerate() {
            let near = &old[around(x, width)];
            *out = T::default();
            near.iter().for_each(|v| *out += *v);
            *out /= near.len() as f32;
        }
    }
    // The rows above, as they were.
    let mut above: VecDeque<Vec<T>> = VecDeque::new();
    for y in 0..height {
        let mut sum = vec![T::default(); width];
        let rows = y * width..around(y, height).end * width;
        let below = values[rows].chunks(width);
        for row in above.iter().map(Vec::as_slice).chain(below) {
            sum.iter_mut().zip(row).for_each(|(sum, v)| *sum += *v);
        }
        let count = around(y, height).len() as f32;
        sum.iter_mut().for_each(|sum| *sum /= count);
        let row = &mut values[y * width..(y + 1) * width];
        above.push_back(row.to_vec());
        if above.len() > radius {
            above.pop_front();
        }
        row.copy_from_slice(&sum);
    }
}
