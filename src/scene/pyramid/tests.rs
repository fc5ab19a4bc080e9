use super::*;

fn noise(size: [u32; 2], channels: u8, srgb: bool) -> Texture {
    let code = |i: u32| (i.wrapping_mul(2_654_435_761) >> 24) as u8;
    let number = size[0] * size[1] * u32::from(channels);
    Texture {
        width: size[0],
        height: size[1],
        channels,
        texels: Texels::Byte((0..number).map(code).collect()),
        srgb,
        ..Texture::default()
    }
}

/// For every size, each level has the mean of the finest up to a code of one texel.
#[test]
fn levels_keep_the_mean() {
    for size in [[64, 64], [63, 17], [1, 40], [37, 1], [5, 3], [255, 2]] {
        for (channels, srgb) in [(1, true), (2, false), (3, true), (4, false), (4, true)] {
            let mut texture = noise(size, channels, srgb);
            let expected = texture.average();
            let colors = if channels < 3 { 1 } else { 3 };
            texture.build_mips();
            let last = texture.mips.last().expect("coarser images");
            assert_eq!([last.width, last.height], [1, 1]);
            for level in texture.mips.iter() {
                let image = Texture {
                    width: level.width,
                    height: level.height,
                    channels: level.channels,
                    texels: level.texels.clone(),
                    ..texture.clone()
                };
                // The rounding error left after the last texel, of each level above.
                let bound = 0.02 / f64::from(level.width * level.height) as f32 + 2e-4;
                for (found, expected) in image.average().iter().zip(expected).take(colors) {
                    let off = (found - expected).abs();
                    assert!(
                        off < bound,
                        "{size:?}, {channels}: {off} at {}",
                        level.width
                    );
                }
            }
        }
    }
}

/// Every level of an image of one colour has exactly its code.
#[test]
fn levels_of_one_colour_have_its_code() {
    for code in [0u8, 1, 37, 188, 254, 255] {
        for srgb in [false, true] {
            let mut texture = Texture {
                srgb,
                ..Texture::rgba(33, 20, vec![[code; 4]; 660])
            };
            texture.build_mips();
            for level in texture.mips.iter() {
                assert_eq!(level.channels, 3);
                let Texels::Byte(codes) = &level.texels else {
                    panic!("eight bits stay eight");
                };
                assert!(codes.iter().all(|&c| c == code), "{code}");
            }
        }
    }
}

/// Levels keep sixteen bits a channel; a texel is the mean of four finer ones.
#[test]
fn levels_of_sixteen_bits_are_means() {
    let texels: Vec<u16> = (0..64 * 64u32).map(|i| (i * 15) as u16).collect();
    let mut texture = Texture {
        width: 64,
        height: 64,
        channels: 1,
        texels: Texels::Word(texels.clone().into()),
        ..Texture::default()
    };
    texture.build_mips();
    let Texels::Word(half) = &texture.mips[0].texels else {
        panic!("sixteen bits stay sixteen");
    };
    for (i, &found) in half.iter().enumerate() {
        let (x, y) = (2 * (i % 32), 2 * (i / 32));
        let at = |x: usize, y: usize| u32::from(texels[64 * y + x]);
        let mean = (at(x, y) + at(x + 1, y) + at(x, y + 1) + at(x + 1, y + 1)) / 4;
        assert!(u32::from(found).abs_diff(mean) <= 1, "{i}: {found}, {mean}");
    }
}
