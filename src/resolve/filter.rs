//! Box filters.

use std::ops::{AddAssign, DivAssign};

/// Width and height.
pub(super) type Size = (usize, usize);

/// A box filter applied twice, in place: about a tent of radius 2 `radius`. At the border a mean over existing pixels.
pub(super) fn tent<T>(size: Size, radius: usize, values: &mut [T])
where
    T: Copy + Default + AddAssign + DivAssign<f32>,
{
    boxed(size, radius, values);
    boxed(size, radius, values);
}

/// Mean over the square of radius `radius`, 1 to 4, around every pixel, in place. At the border over existing pixels.
pub(super) fn boxed<T>(size: Size, radius: usize, values: &mut [T])
where
    T: Copy + Default + AddAssign + DivAssign<f32>,
{
    match radius {
        1 => boxed_over::<T, 3>(size, values),
        2 => boxed_over::<T, 5>(size, values),
        3 => boxed_over::<T, 7>(size, values),
        4 => boxed_over::<T, 9>(size, values),
        _ => unreachable!("a filter of radius {radius}"),
    }
}

/// [`boxed`] over squares of `N` pixels a side, in one sweep that buffers the row means of `N` rows.
fn boxed_over<T, const N: usize>((width, height): Size, values: &mut [T])
where
    T: Copy + Default + AddAssign + DivAssign<f32>,
{
    let radius = N / 2;
    let around = |at: usize, end: usize| at.saturating_sub(radius)..(at + radius + 1).min(end);
    let mut along = vec![T::default(); N * width];
    for last in 0..height + radius {
        if last < height {
            let old = &values[last * width..][..width];
            let row = &mut along[last % N * width..][..width];
            let left = radius.min(width);
            let right = (width - left).max(left);
            for x in (0..left).chain(right..width) {
                let near = &old[around(x, width)];
                row[x] = mean(near.len(), |i| near[i]);
            }
            // Pixels with all neighbours, in a long loop without branches.
            let inner = &mut row[left..right];
            let count = inner.len();
            let near: [&[T]; N] =
                std::array::from_fn(|i| old.get(i..i + count).unwrap_or_default());
            for (x, out) in inner.iter_mut().enumerate() {
                *out = mean(N, |i| near[i][x]);
            }
        }
        let Some(y) = last.checked_sub(radius) else {
            continue;
        };
        let rows = around(y, height);
        let row = |y: usize| &along[y % N * width..][..width];
        let out = &mut values[y * width..][..width];
        if rows.len() == N {
            let near: [&[T]; N] = std::array::from_fn(|i| row(rows.start + i));
            for (x, out) in out.iter_mut().enumerate() {
                *out = mean(N, |i| near[i][x]);
            }
        } else {
            for (x, out) in out.iter_mut().enumerate() {
                *out = mean(rows.len(), |i| row(rows.start + i)[x]);
            }
        }
    }
}

/// The mean of `count` values.
#[inline(always)]
fn mean<T>(count: usize, value: impl Fn(usize) -> T) -> T
where
    T: Copy + Default + AddAssign + DivAssign<f32>,
{
    let mut mean = T::default();
    (0..count).for_each(|i| mean += value(i));
    mean /= count as f32;
    mean
}
