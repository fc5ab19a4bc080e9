//! Files of recordings, so that a stopped training traces no path twice.

use crate::record::event::StoredEvent;
use crate::record::lists::RoughnessLists;
use crate::record::recording::{RecordedPath, RecordedPixel, Recording};
use opsr::files::{FileError, Sealed};
use serde::{Deserialize, Serialize};
use std::path::Path;

const FILE: Sealed = Sealed {
    kind: "recording",
    version: 1,
    // More than the memory that a recording may take.
    most: 1 << 36,
};

/// Header of the file. Payload: pixels, paths pixel by pixel, events, ends of the lists, their values.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Header {
    fingerprint: String,
    pixels: usize,
    paths: usize,
    events: usize,
    lists: usize,
    values: usize,
}

impl Header {
    fn check(&self, path: &Path, fingerprint: &str) -> Result<(), FileError> {
        if self.fingerprint == fingerprint {
            return Ok(());
        }
        let what = "belongs to other settings, another crop or another version of the program";
        Err(FileError::content(path, what))
    }
}

/// Bytes of a pixel: samples, constant, its square, number of paths.
const PIXEL: usize = 4 + 24 + 8 + 4;

/// Bytes of a path: constant, first event, number of events.
const PATH: usize = 12 + 4 + 4;

impl Recording {
    /// Writes the file, whole or not at all. `fingerprint` identifies all inputs of the recording.
    pub fn save(&self, path: &Path, fingerprint: &str) -> Result<(), FileError> {
        let header = Header {
            fingerprint: fingerprint.into(),
            pixels: self.pixels.len(),
            paths: self.pixels.iter().map(|p| p.paths.len()).sum(),
            events: self.events.len(),
            lists: self.lists.len(),
            values: self.lists.codes().map(|c| self.lists.list(c).len()).sum(),
        };
        FILE.save(path, &header, |out| {
            for pixel in &self.pixels {
                out.write_all(&pixel.samples.to_le_bytes())?;
                for number in pixel.constant.iter().chain([&pixel.constant_squared]) {
                    out.write_all(&number.to_le_bytes())?;
                }
                out.write_all(&(pixel.paths.len() as u32).to_le_bytes())?;
            }
            for path in self.pixels.iter().flat_map(|p| &p.paths) {
                for number in path.constant {
                    out.write_all(&number.to_le_bytes())?;
                }
                out.write_all(&path.first.to_le_bytes())?;
                out.write_all(&path.count.to_le_bytes())?;
            }
            for event in &self.events {
                out.write_all(&event.to_bytes())?;
            }
            let mut end = 0;
            for code in self.lists.codes() {
                end += self.lists.list(code).len() as u32;
                out.write_all(&end.to_le_bytes())?;
            }
            for value in self.lists.codes().flat_map(|c| self.lists.list(c)) {
                out.write_all(&value.to_le_bytes())?;
            }
            Ok(())
        })
    }

    /// Fails for a file that was saved with another fingerprint; reads the header only.
    pub fn check(path: &Path, fingerprint: &str) -> Result<(), FileError> {
        let (header, _): (Header, _) = FILE.stream(path).map_err(|problem| problem.at(path))?;
        header.check(path, fingerprint)
    }

    /// Reads the recording of a crop of `pixels` pixels; fails for another fingerprint or size and for a damaged file.
    pub fn load(path: &Path, fingerprint: &str, pixels: usize) -> Result<Self, FileError> {
        let (header, payload): (Header, _) = FILE.load(path)?;
        header.check(path, fingerprint)?;
        let damaged = |what| FileError::content(path, format!("a damaged recording: {what}"));
        if header.pixels != pixels {
            return Err(damaged("another number of pixels"));
        }
        read(&header, &payload).map_err(damaged)
    }
}

/// Takes `count` records of `N` bytes from the front.
fn take<'a, const N: usize>(
    bytes: &mut &'a [u8],
    count: usize,
) -> Result<&'a [[u8; N]], &'static str> {
    let length = count.checked_mul(N);
    let parts = length.and_then(|length| bytes.split_at_checked(length));
    let (records, rest) = parts.ok_or("cut short")?;
    *bytes = rest;
    Ok(records.as_chunks().0)
}

fn four(record: &[u8], at: usize) -> [u8; 4] {
    std::array::from_fn(|i| record[at + i])
}

fn eight(record: &[u8], at: usize) -> [u8; 8] {
    std::array::from_fn(|i| record[at + i])
}

fn read(header: &Header, payload: &[u8]) -> Result<Recording, &'static str> {
    let mut rest = payload;
    let pixels = take::<PIXEL>(&mut rest, header.pixels)?;
    let paths = take::<PATH>(&mut rest, header.paths)?;
    let events = take::<{ StoredEvent::BYTES }>(&mut rest, header.events)?;
    let ends = take::<4>(&mut rest, header.lists)?;
    let values = take::<4>(&mut rest, header.values)?;
    if !rest.is_empty() {
        return Err("too long");
    }

    let values: Vec<f32> = values.iter().map(|v| f32::from_le_bytes(*v)).collect();
    if !values.iter().all(|v| (0.0..=1.0).contains(v)) {
        return Err("a roughness outside of [0, 1]");
    }
    let mut lists = Vec::with_capacity(ends.len());
    let mut start = 0;
    for end in ends {
        let end = u32::from_le_bytes(*end) as usize;
        let list = values.get(start..end).filter(|list| !list.is_empty());
        lists.push(list.ok_or("a list of no roughness values")?);
        start = end;
    }
    let lists = RoughnessLists::from_sorted(lists.into_iter());

    let events: Option<Vec<StoredEvent>> = events.iter().map(StoredEvent::from_bytes).collect();
    let events = events.ok_or("an event that is not finite")?;
    if events.iter().any(|e| e.code as usize >= lists.len()) {
        return Err("an event without a list");
    }

    let mut paths = paths.iter().map(|path| RecordedPath {
        constant: [0, 4, 8].map(|at| f32::from_le_bytes(four(path, at))),
        first: u32::from_le_bytes(four(path, 12)),
        count: u32::from_le_bytes(four(path, 16)),
    });
    let mut read_pixel = |pixel: &[u8; PIXEL]| {
        let number = |at| f64::from_le_bytes(eight(pixel, at));
        let count = u32::from_le_bytes(four(pixel, 36)) as usize;
        RecordedPixel {
            samples: u32::from_le_bytes(four(pixel, 0)),
            constant: [4, 12, 20].map(number),
            constant_squared: number(28),
            paths: paths.by_ref().take(count).collect(),
        }
    };
    let pixels: Vec<RecordedPixel> = pixels.iter().map(&mut read_pixel).collect();
    if pixels.iter().map(|p| p.paths.len()).sum::<usize>() != header.paths {
        return Err("paths without a pixel");
    }
    let usable = |path: &RecordedPath| {
        let end = u64::from(path.first) + u64::from(path.count);
        end <= events.len() as u64 && path.constant.iter().all(|c| c.is_finite())
    };
    let finite = |p: &RecordedPixel| {
        p.constant.iter().all(|c| c.is_finite()) && p.constant_squared.is_finite()
    };
    if !pixels
        .iter()
        .all(|p| finite(p) && p.paths.iter().all(usable))
    {
        return Err("a path that is not finite or has events that do not exist");
    }
    Ok(Recording {
        pixels,
        events,
        lists,
    })
}
