//! Numbers of frames, and names of their files.

use std::path::{Path, PathBuf};
use std::str::FromStr;

/// Default number of frames per second.
const FPS: f64 = 24.0;

/// Maximum number of frames of a film: 12 hours at 24 frames per second.
const MAX_FRAMES: u32 = 1 << 20;

/// Frames of an animation, both ends included, such as `1..48` or `0..99@30`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FrameRange {
    /// Number of the first frame; frame 0 is the start of the animations.
    pub first: u32,
    /// Number of the last frame.
    pub last: u32,
    /// Frames per second.
    pub fps: f64,
}

impl FrameRange {
    /// The numbers of the frames.
    pub fn numbers(&self) -> impl ExactSizeIterator<Item = u32> + use<> {
        (self.first..self.last + 1).collect::<Vec<_>>().into_iter()
    }
}

impl FromStr for FrameRange {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let read = || {
            let (range, fps) = match text.split_once('@') {
                Some((range, fps)) => (range, fps.parse().ok()?),
                None => (text, FPS),
            };
            let (first, last) = range.split_once("..")?;
            let (first, last): (u32, u32) = (first.parse().ok()?, last.parse().ok()?);
            let possible = first <= last && last - first < MAX_FRAMES && last < u32::MAX;
            (possible && fps > 0.0 && f64::is_finite(fps)).then_some(Self { first, last, fps })
        };
        let what = "expected the first and the last frame, such as 1..48, or with frames per second, such as 1..48@30";
        read().ok_or_else(|| what.into())
    }
}

/// Names of the files of frames: a path whose name has a run of `#`, which stands for the number with as many digits.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct FrameNames {
    folder: PathBuf,
    before: String,
    digits: usize,
    after: String,
}

impl FrameNames {
    /// The names that a path stands for; `None` without one run of one to nine `#`, or for a path that is not UTF-8.
    pub fn new(path: &Path) -> Option<Self> {
        let name = path.file_name()?.to_str()?;
        let first = name.find('#')?;
        let rest = &name[first..];
        let after = rest.trim_start_matches('#');
        let digits = rest.len() - after.len();
        (digits <= 9 && !after.contains('#')).then(|| Self {
            folder: path.parent().unwrap_or(Path::new("")).to_owned(),
            before: name[..first].to_owned(),
            digits,
            after: after.to_owned(),
        })
    }

    /// The file of a frame.
    pub fn of(&self, number: u32) -> PathBuf {
        let Self {
            before,
            digits,
            after,
            ..
        } = self;
        self.folder
            .join(format!("{before}{number:0digits$}{after}"))
    }

    /// The frame of a file with such a name.
    fn number(&self, name: &str) -> Option<u32> {
        let digits = name
            .strip_prefix(&*self.before)?
            .strip_suffix(&*self.after)?;
        let number = digits.parse().ok()?;
        (self.of(number).file_name()?.to_str()? == name).then_some(number)
    }

    /// Numbers of the frames whose files exist, in ascending order.
    pub fn found(&self) -> std::io::Result<Vec<u32>> {
        let folder = match self.folder.as_os_str().is_empty() {
            true => Path::new("."),
            false => &self.folder,
        };
        let mut numbers = Vec::new();
        for entry in std::fs::read_dir(folder)? {
            numbers.extend(
                entry?
                    .file_name()
                    .to_str()
                    .and_then(|name| self.number(name)),
            );
        }
        numbers.sort_unstable();
        Ok(numbers)
    }
}

impl std::fmt::Display for FrameNames {
    fn fmt(&self, out: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let name = format!("{}{}{}", self.before, "#".repeat(self.digits), self.after);
        write!(out, "{}", self.folder.join(name).display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn range_of_frames_is_read() {
        let read = |text: &str| text.parse::<FrameRange>();
        let range = read("1..48").unwrap();
        assert_eq!((range.first, range.last, range.fps), (1, 48, 24.0));
        assert_eq!(range.numbers().len(), 48);
        assert_eq!(read("5..5@30").unwrap().fps, 30.0);
        for bad in [
            "",
            "1",
            "2..1",
            "1..",
            "..3",
            "-1..3",
            "1..2@0",
            "1..2@x",
            "1..2@inf",
            "0..4294967295",
            "1...3",
        ] {
            assert!(read(bad).is_err(), "{bad}");
        }
    }

    #[test]
    fn names_of_frames_have_their_digits() {
        let names = FrameNames::new(Path::new("a#/out_####.exr")).unwrap();
        assert_eq!(names.of(7), Path::new("a#/out_0007.exr"));
        assert_eq!(names.of(12345), Path::new("a#/out_12345.exr"));
        assert_eq!(names.number("out_0012.exr"), Some(12));
        for other in [
            "out_12.exr",
            "out_0012.png",
            "out_+012.exr",
            "0012.exr",
            "out_00012.exr",
        ] {
            assert_eq!(names.number(other), None, "{other}");
        }
        for none in ["out.exr", "#_#.exr", "##########.exr", ""] {
            assert_eq!(FrameNames::new(Path::new(none)), None, "{none}");
        }
    }
}
