use super::*;

const SIZE: UVec2 = UVec2::new(3, 2);

fn blank() -> LevelFilm {
    LevelFilm::new(SIZE, Window::full(SIZE), 2)
}

/// Constant values.
const PATH: PathLevels<'_> = PathLevels {
    levels: &[Rgb::new(0.7, 1.3, 1e-3), Rgb::splat(0.1)],
    shared: Rgb::splat(0.3),
    features: [0.6, -0.8, 0.0, 7.3, 0.0, 0.0, 1.0, 5.0, 0.5, 0.5, 0.2],
};

/// Adds samples to the pixel with this index.
fn push(film: &mut LevelFilm, index: usize, samples: Range<u32>) {
    samples.for_each(|sample| film.push(index, sample, &PATH));
}

impl LevelFilm {
    /// A film of `tile` with this film's sums so far. Panics if the tile leaves the window.
    fn cut(&self, tile: Window) -> Self {
        let mut cut = Self::new(self.size, tile, self.levels);
        let stride = BATCHES * (self.levels + 1);
        for row in 0..tile.h {
            let (mine, theirs, w) = self.row(&tile, row);
            cut.counts[theirs..theirs + w].copy_from_slice(&self.counts[mine..mine + w]);
            cut.features[theirs..theirs + w].copy_from_slice(&self.features[mine..mine + w]);
            cut.sums[theirs * stride..(theirs + w) * stride]
                .copy_from_slice(&self.sums[mine * stride..(mine + w) * stride]);
            if let Some(all) = &self.carried {
                let blank = || Carried::new(tile.len(), self.levels);
                let part = cut.carried.get_or_insert_with(blank);
                part.copy(theirs, all, mine, w, stride);
            }
        }
        cut
    }
}

#[test]
fn complete_film_lends_an_empty_batch_the_others_mean() {
    let size = UVec2::new(20, 10);
    let mut film = LevelFilm::new(size, Window::full(size), 2);
    (0..200).for_each(|index| push(&mut film, index, 0..8));
    assert!(matches!(film.complete(), Some(Cow::Borrowed(_))));
    let whole = film.clone();
    let mut film = LevelFilm::new(size, Window::full(size), 2);
    for index in 0..200 {
        // Two pixels of two hundred have no sample in one batch.
        (0..8u32)
            .filter(|sample| index > 1 || sample % 4 != 2)
            .for_each(|sample| push(&mut film, index, sample..sample + 1));
    }
    let complete = film.complete().expect("a film");
    for level in 0..=2 {
        let (found, expected) = (complete.batch_means(level), whole.batch_means(level));
        for (a, b) in found.iter().zip(&expected) {
            let pairs = a.pixels.iter().zip(&b.pixels);
            assert!(
                pairs
                    .map(|(a, b)| (*a - *b).abs().max_element())
                    .all(|d| d < 1e-6)
            );
        }
    }
    // With a third such pixel, two batches are left.
    film.counts[2][2] = 0;
    assert_eq!(film.batches(), 2);
    let complete = film.complete().expect("two batches");
    assert_eq!(complete.shares()[2..], [0.0; 2]);
    film.counts[2][1] = 0;
    film.counts[3][1] = 0;
    film.counts[4][1] = 0;
    assert_eq!((film.batches(), film.complete()), (1, None));
}

/// Every half has its own pixels' light, and between them a mean of similar neighbours.
#[test]
fn halves_of_one_sample_are_two_chessboards() {
    let size = UVec2::new(4, 3);
    // In the frame, the window begins with a pixel of the second half.
    let window = Window {
        x: 3,
        y: 2,
        w: 4,
        h: 3,
    };
    let mut film = LevelFilm::new(size + 4, window, 1);
    let light = |index: usize, level: usize| Rgb::splat(1.0 + index as f32 + 100.0 * level as f32);
    // Pixel 6 has no sample.
    for index in (0..12).filter(|index| *index != 6) {
        let path = PathLevels {
            levels: &[light(index, 0)],
            shared: light(index, 1),
            features: [index as f32; FEATURES],
        };
        film.push(index, 0, &path);
    }
    // Pixel 0 has no similar neighbour. Right of pixel 5 is the one without a sample; above it is twice the weight.
    let mut weights = [[1.0, 1.0, 2.0, 1.0]; 12];
    weights[0] = [0.0; 4];
    let halves = film.halves(&weights);
    assert_eq!(halves.batches(), 2);
    for level in 0..2 {
        let at = |batch: usize, index: usize| halves.batch_mean(index, batch, level);
        let mean = |of: &[(usize, f32)]| {
            let sum: Rgb = of.iter().map(|(i, w)| *w * light(*i, level)).sum();
            sum / of.iter().map(|(_, w)| w).sum::<f32>()
        };
        let near = |a: Rgb, b: Rgb| assert!((a - b).abs().max_element() < 1e-4, "{a} {b}");
        // (3, 2) is odd: its own light is in the second half.
        near(at(0, 0), light(0, level));
        near(at(1, 0), light(0, level));
        near(at(0, 1), light(1, level));
        near(at(1, 1), mean(&[(0, 1.0), (2, 1.0), (5, 1.0)]));
        near(at(1, 5), light(5, level));
        near(at(0, 5), mean(&[(4, 1.0), (1, 2.0), (9, 1.0)]));
        let around = mean(&[(5, 1.0), (7, 1.0), (2, 2.0), (10, 1.0)]);
        near(at(0, 6), around);
        near(at(1, 6), around);
    }
    let features = halves.features();
    assert!((features[5][0] - 5.0).abs() < 1e-5 && features[6][0] == 0.0);
}

/// In single precision 0.7 added a million times is off by up to 1 %.
#[test]
fn means_of_millions_of_samples_are_those_of_few() {
    let mut film = blank();
    push(&mut film, 1, 0..4_000_003);
    let close = |found: f32, expected: f32, tolerance: f32| {
        assert!(
            (found / expected - 1.0).abs() < tolerance,
            "{found} {expected}"
        );
    };
    for (level, expected) in [[0.7, 1.3, 1e-3], [0.1; 3], [0.3; 3]]
        .into_iter()
        .enumerate()
    {
        let batches = film.batch_means(level);
        for buffer in batches.iter().chain([&film.mean(level)]) {
            let found = buffer.pixels[1].to_array();
            (0..3).for_each(|c| close(found[c], expected[c], 5e-4));
        }
    }
    let features = film.features()[1];
    assert_eq!(features[2], 0.0);
    close(features[0], 0.6, 2e-3);
    close(features[1], -0.8, 2e-3);
    close(features[3], 7.3, 2e-3);
}

#[test]
fn carried_sums_go_with_tiles_bands_and_files() {
    let last = BATCHES as u32 * (CARRY - 1);
    for (end, magic) in [
        (last, MAGIC),
        (last + 1, MAGIC_CARRIED),
        (last + 7, MAGIC_CARRIED),
    ] {
        let (mut whole, mut film) = (blank(), blank());
        for index in 0..SIZE.element_product() as usize {
            push(&mut whole, index, 0..end + 9);
        }
        // In tiles, and read back from a file.
        for tile in Window::full(SIZE).tiles(2) {
            let mut part = film.cut(tile);
            (0..tile.len()).for_each(|index| push(&mut part, index, 0..end));
            film.paste(&part);
        }
        // In bands.
        let mut again = blank();
        for mut band in again.bands(1, &(0..end)) {
            for sample in 0..end {
                (0..SIZE.x as usize).for_each(|index| band.push(index, sample, &PATH));
            }
        }
        assert!(again == film);
        let mut bytes = Vec::new();
        film.write(&mut bytes).unwrap();
        assert_eq!(&bytes[..8], magic);
        let length = bytes.len() as u64;
        assert_eq!(length, LevelFilm::HEAD + LevelFilm::bytes_with(6, 2, end));
        let read = |bytes: &mut &[u8]| LevelFilm::read(SIZE, Window::full(SIZE), bytes);
        let mut rest = &bytes[..];
        let mut again = read(&mut rest).unwrap();
        assert!(again == film && rest.is_empty());
        assert!(read(&mut &bytes[..bytes.len() - 1]).is_err());
        let mut absurd = bytes.clone();
        let last = bytes.len() - 4;
        absurd[last..].copy_from_slice(&f32::NAN.to_le_bytes());
        let error = read(&mut &absurd[..]).unwrap_err();
        assert_eq!(error, "sums of the levels are not finite");
        if film.carried.is_none() {
            absurd[last..].copy_from_slice(&(-1.0f32).to_le_bytes());
            let error = read(&mut &absurd[..]).unwrap_err();
            assert_eq!(error, "sums of the levels are negative");
        }
        for tile in Window::full(SIZE).tiles(1) {
            let mut part = again.cut(tile);
            push(&mut part, 0, end..end + 9);
            again.paste(&part);
        }
        assert_eq!(again, whole);
    }
}
