use super::*;
use std::collections::HashSet;

const DOMAINS: [Domain; 9] = [
    Domain::Camera,
    Domain::Light,
    Domain::Chain,
    Domain::Pilot,
    Domain::Recording,
    Domain::Validation,
    Domain::EventRoulette,
    Domain::Levels,
    Domain::Sobol,
];

#[test]
fn derived_seeds_are_distinct() {
    let mut seen = HashSet::new();
    for user in [0, 1, 2, u64::MAX] {
        for domain in DOMAINS {
            for n in 0..25_000 {
                seen.insert(Seed(user).derive(domain, n).0);
            }
        }
    }
    assert_eq!(seen.len(), 900_000);
    // Derivations do not commute: seeds of seeds are distinct too.
    let (a, b) = ((Domain::Recording, 1), (Domain::EventRoulette, 2));
    let derive = |first: (Domain, u64), second: (Domain, u64)| {
        Seed(5).derive(first.0, first.1).derive(second.0, second.1)
    };
    assert_ne!(derive(a, b), derive(b, a));
}

/// Pictures of a seed must never change.
#[test]
fn determinism_of_seeds_and_streams() {
    assert_eq!(Seed(7).derive(Domain::Camera, 0), Seed(7));
    let derived = DOMAINS.map(|domain| Seed(7).derive(domain, 3).0);
    let expected = [
        0x1322_a6ec_e20e_d108,
        0x797b_e99e_e4a4_1d21,
        0xbbff_0b8a_0203_a06a,
        0xa90c_efa4_d778_4f83,
        0x1097_9345_f0f4_1b25,
        0x9dfa_333b_11b9_2a0e,
        0x9509_00c5_0b1e_f019,
        0x3a91_1a00_010c_7970,
        0xf5e0_c2ef_7880_1ae1,
    ];
    assert_eq!(derived, expected);
    let source = Independent { seed: Seed(7) };
    let mut stream = source.stream(UVec2::new(3, 5), 11);
    let numbers: [f32; 4] = std::array::from_fn(|_| stream.next_1d() * 16_777_216.0);
    assert_eq!(
        numbers,
        [2_144_111.0, 5_361_793.0, 8_101_002.0, 1_165_573.0]
    );
}

#[test]
fn the_choice_of_a_light_has_53_uniform_bits() {
    let mut stream = Independent { seed: Seed(3) }.stream(UVec2::ZERO, 0);
    let n = 100_000;
    let mut ones = [0u32; 53];
    for _ in 0..n {
        let before = stream.clone();
        let u = stream.vertex();
        assert!((0.0..1.0).contains(&u.light.pick));
        let bits = (u.light.pick * 2f64.powi(53)) as u64;
        for (i, count) in ones.iter_mut().enumerate() {
            *count += (bits >> i & 1) as u32;
        }
        // The upper bits are the second number of the vertex, and the choice uses no further number.
        let mut plain = before;
        let numbers: [f32; 8] = std::array::from_fn(|_| plain.next_1d());
        assert_eq!(bits >> 29, (numbers[1] * 16_777_216.0) as u64);
        assert_eq!((u.material, u.roulette), (numbers[0], numbers[7]));
    }
    // Five standard deviations.
    let far = 5.0 * (0.25 * f64::from(n)).sqrt();
    for (i, &count) in ones.iter().enumerate() {
        assert!(
            (f64::from(count) - 0.5 * f64::from(n)).abs() < far,
            "bit {i}: {count}"
        );
    }
}

/// The light paths of every aligned square of 4 x 4 pixels have 16 different directions: one in each of 16 parts of
/// either coordinate, and in each of 4 x 4 cells. Another sample has other directions.
#[test]
fn light_paths_of_neighbours_cover_directions() {
    let columns = 20;
    let source = LightSource::new(SamplerKind::Sobol, Seed(3), columns);
    let emission = |x: u32, y: u32, sample| {
        let mut stream = source.stream(y * columns + x, sample);
        stream.emission()
    };
    for (left, top) in [(0, 0), (4, 8), (16, 4)] {
        for sample in 0..3 {
            let pixels = (0..16).map(|i| (left + i % 4, top + i / 4));
            let numbers: Vec<EmissionU> = pixels.map(|(x, y)| emission(x, y, sample)).collect();
            let cells = |cell: &dyn Fn(&EmissionU) -> u32| {
                numbers.iter().map(cell).collect::<HashSet<u32>>().len()
            };
            assert_eq!(cells(&|u| (16.0 * u.direction.x) as u32), 16);
            assert_eq!(cells(&|u| (16.0 * u.direction.y) as u32), 16);
            let at = |p: Vec2| (4.0 * p.x) as u32 + 4 * (4.0 * p.y) as u32;
            assert_eq!(cells(&|u| at(u.direction)), 16);
            // The choice and each coordinate of the point are stratified in one dimension only.
            assert_eq!(cells(&|u| (16.0 * u.pick) as u32), 16);
            assert_eq!(cells(&|u| (16.0 * u.point.x) as u32), 16);
            assert_eq!(cells(&|u| (16.0 * u.point.y) as u32), 16);
            assert_ne!(numbers[0], emission(left, top, sample + 1));
        }
    }
}

/// Pixels more than 65,536 apart have different points.
#[test]
fn light_paths_of_wide_frames_differ() {
    let source = LightSource::new(SamplerKind::Sobol, Seed(3), 1 << 17);
    let emission = |path| source.stream(path, 0).emission();
    assert_ne!(emission(5), emission(5 + (1 << 16)));
    let tall = LightSource::new(SamplerKind::Sobol, Seed(3), 1);
    let emission = |path| tall.stream(path, 0).emission();
    assert_ne!(emission(5), emission(5 + (1 << 16)));
}

/// Every vertex of a light path draws its own point on the lens, independent of the numbers of emission.
#[test]
fn light_paths_draw_points_on_the_lens_independently() {
    let source = LightSource::new(SamplerKind::Sobol, Seed(3), 64);
    let mut products = [0.0f64; 3];
    let n = 4096;
    for path in 0..n {
        let mut stream = source.stream(path, 1);
        let u = stream.emission();
        let (a, b) = (stream.lens(), stream.lens());
        assert_ne!(a, b);
        let centred = |x: f32| f64::from(x) - 0.5;
        products[0] += centred(u.point.x) * centred(a.x);
        products[1] += centred(u.direction.x) * centred(a.x);
        products[2] += centred(a.x) * centred(b.x);
    }
    for product in products {
        // Five standard deviations of the mean of a product of two uniform numbers, 1/12 each.
        assert!(
            product.abs() < 5.0 / 12.0 * f64::from(n).sqrt(),
            "{product}"
        );
    }
}

/// Sixteen samples of a pixel have one opacity in each sixteenth on each of the first edges.
#[test]
fn opacities_of_a_pixel_are_even() {
    let opacities = |source: &CameraSource, pixel, sample| {
        let mut stream = source.stream(pixel, sample);
        [(); 5].map(|()| stream.opacity())
    };
    let independent = CameraSource::new(SamplerKind::Independent, Seed(5), 1);
    assert_eq!(opacities(&independent, UVec2::ZERO, 3), [None; 5]);
    let source = CameraSource::new(SamplerKind::Sobol, Seed(5), 1);
    for place in 0..100 {
        let pixel = UVec2::new(place % 10, place / 10);
        for first in [0, 16, 32] {
            let mut seen = [[false; 16]; 4];
            for sample in first..first + 16 {
                let all = opacities(&source, pixel, sample);
                assert_eq!(all[4], None);
                for (edge, u) in all.into_iter().flatten().enumerate() {
                    seen[edge][(16.0 * u) as usize] = true;
                }
            }
            assert_eq!(seen, [[true; 16]; 4]);
        }
    }
}

/// The opacity of a sample says nothing of its other numbers, nor of that of another edge.
#[test]
fn opacities_are_independent_of_other_numbers() {
    let source = CameraSource::new(SamplerKind::Sobol, Seed(6), 1);
    const NUMBERS: usize = 13;
    let n = 40_000;
    let mut products = [0.0; NUMBERS];
    for place in 0..n {
        let mut stream = source.stream(UVec2::new(place % 200, place / 200), 5);
        let [first, second] = [(); 2].map(|()| stream.opacity().expect("a number"));
        let film = stream.film();
        let (a, b) = (stream.vertex(), stream.vertex());
        let numbers: [f64; NUMBERS] = [
            second,
            film.x.into(),
            film.y.into(),
            a.material.into(),
            a.light.pick,
            a.light.at.x.into(),
            a.light.at.y.into(),
            a.lobe[0].into(),
            a.lobe[1].into(),
            a.lobe[2].into(),
            a.roulette.into(),
            b.material.into(),
            b.lobe[0].into(),
        ];
        for (sum, u) in products.iter_mut().zip(numbers) {
            *sum += (first - 0.5) * (u - 0.5);
        }
    }
    // Five standard deviations.
    let far = 5.0 * f64::from(n).sqrt() / 12.0;
    assert!(products.iter().all(|sum| sum.abs() < far), "{products:?}");
}
