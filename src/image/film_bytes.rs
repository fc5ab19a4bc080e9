//! A film as bytes, for checkpoints: every bit is kept, so a resumed render is bitwise an uninterrupted one.
//!
//! Little endian throughout: the magic word, six `u32` of frame and window, two `u64` of refusals and the
//! remembered ones, then 52 bytes a pixel (n, mean, sum of squared deviations).

use super::film::{Cause, Film, FilmError, Rejected, RejectedSample, Window};
use crate::math::moments::Moments;
use crate::math::{DVec3, UVec2};
use std::io::{self, Write};

const MAGIC: &[u8; 8] = b"opsrflm1";
const PIXEL_BYTES: usize = 4 + 6 * 8;

impl Film {
    /// The film as bytes, for [`Film::from_bytes`].
    ///
    /// ```
    /// use opsr::{image::Film, math::{Rgb, UVec2}};
    /// let mut film = Film::new(UVec2::new(2, 1));
    /// film.push(1, Rgb::new(0.1, 0.2, 0.3), 0);
    /// assert_eq!(Film::from_bytes(&film.to_bytes()).unwrap(), film);
    /// ```
    pub fn to_bytes(&self) -> Vec<u8> {
        let mut out = Vec::with_capacity(256 + self.pixels.len() * PIXEL_BYTES);
        // A vector takes everything.
        let _ = self.write(&mut out);
        out
    }

    /// Writes the bytes of [`Film::to_bytes`] piece by piece: nothing of the film's size is held.
    pub fn write(&self, out: &mut impl Write) -> io::Result<()> {
        out.write_all(MAGIC)?;
        let w = &self.window;
        for v in [self.size.x, self.size.y, w.x, w.y, w.w, w.h] {
            out.write_all(&v.to_le_bytes())?;
        }
        out.write_all(&self.rejected.nan.to_le_bytes())?;
        out.write_all(&self.rejected.infinite.to_le_bytes())?;
        out.write_all(&(self.rejected.first.len() as u32).to_le_bytes())?;
        for r in &self.rejected.first {
            let cause = match r.cause {
                Cause::Nan => 0,
                Cause::Infinite => 1,
            };
            for v in [r.pixel.x, r.pixel.y, r.sample, cause] {
                out.write_all(&v.to_le_bytes())?;
            }
        }
        for m in &self.pixels {
            out.write_all(&m.n.to_le_bytes())?;
            for v in m.mean.to_array().into_iter().chain(m.m2().to_array()) {
                out.write_all(&v.to_le_bytes())?;
            }
        }
        Ok(())
    }

    /// The film of these bytes, all of them.
    pub fn from_bytes(mut bytes: &[u8]) -> Result<Self, FilmError> {
        let film = Self::read(&mut bytes)?;
        match bytes {
            [] => Ok(film),
            _ => Err(FilmError::Stored("bytes after the last pixel")),
        }
    }

    /// Takes a film from the front of `bytes`.
    pub fn read(bytes: &mut &[u8]) -> Result<Self, FilmError> {
        let mut input = Input(bytes);
        if &input.take::<8>()? != MAGIC {
            return Err(FilmError::Stored("not a film, or of another version"));
        }
        let size = UVec2::new(input.u32()?, input.u32()?);
        let window = Window {
            x: input.u32()?,
            y: input.u32()?,
            w: input.u32()?,
            h: input.u32()?,
        };
        let rejected = input.rejected()?;
        // Compared before memory is taken, so a damaged size cannot ask for more than the file holds.
        let length = window.len().checked_mul(PIXEL_BYTES);
        if length.is_none_or(|length| length > input.0.len()) {
            return Err(FilmError::Stored("fewer pixels than the window has"));
        }
        let mut film = Self::cropped(size, window)?;
        film.rejected = rejected;
        for m in &mut film.pixels {
            *m = Moments::from_parts(input.u32()?, input.dvec3()?, input.dvec3()?);
        }
        *bytes = input.0;
        Ok(film)
    }
}

/// The bytes not read yet.
struct Input<'a>(&'a [u8]);

impl Input<'_> {
    fn take<const N: usize>(&mut self) -> Result<[u8; N], FilmError> {
        let (head, rest) = self
            .0
            .split_first_chunk::<N>()
            .ok_or(FilmError::Stored("cut short"))?;
        self.0 = rest;
        Ok(*head)
    }

    fn u32(&mut self) -> Result<u32, FilmError> {
        Ok(u32::from_le_bytes(self.take()?))
    }

    fn u64(&mut self) -> Result<u64, FilmError> {
        Ok(u64::from_le_bytes(self.take()?))
    }

    fn f64(&mut self) -> Result<f64, FilmError> {
        Ok(f64::from_le_bytes(self.take()?))
    }

    fn dvec3(&mut self) -> Result<DVec3, FilmError> {
        Ok(DVec3::new(self.f64()?, self.f64()?, self.f64()?))
    }

    fn rejected(&mut self) -> Result<Rejected, FilmError> {
        let (nan, infinite) = (self.u64()?, self.u64()?);
        let mut first = Vec::new();
        let count = self.u32()? as usize;
        if count > Rejected::REMEMBERED {
            return Err(FilmError::Stored("more refused samples than are ever kept"));
        }
        for _ in 0..count {
            first.push(RejectedSample {
                pixel: UVec2::new(self.u32()?, self.u32()?),
                sample: self.u32()?,
                cause: match self.u32()? {
                    0 => Cause::Nan,
                    1 => Cause::Infinite,
                    _ => return Err(FilmError::Stored("unknown cause of refusal")),
                },
            });
        }
        Ok(Rejected {
            nan,
            infinite,
            first,
        })
    }
}
