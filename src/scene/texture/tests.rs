use super::*;

fn ramp(wrap: Wrap) -> Texture {
    let texels = [
        [0, 0, 0, 255],
        [100, 0, 0, 255],
        [200, 0, 0, 255],
        [250, 0, 0, 255],
    ];
    Texture {
        wrap: [wrap; 2],
        ..Texture::rgba(4, 1, texels)
    }
}

#[test]
fn bilinear_sampling_is_exact_at_texel_centres() {
    let t = ramp(Wrap::Clamp);
    let red = |u: f32| t.sample(Vec2::new(u, 0.5))[0] * 255.0;
    assert!((red(0.375) - 100.0).abs() < 1e-3);
    assert!((red(0.5) - 150.0).abs() < 1e-3);
    assert_eq!(red(-3.0), 0.0);
    assert!((red(7.0) - 250.0).abs() < 1e-3);
}

#[test]
fn texture_wrap_modes() {
    let at = |wrap, u: f32| ramp(wrap).sample(Vec2::new(u, 0.5))[0] * 255.0;
    assert!((at(Wrap::Repeat, 1.375) - 100.0).abs() < 1e-3);
    assert!((at(Wrap::Repeat, -0.625) - 100.0).abs() < 1e-3);
    assert!((at(Wrap::Mirror, 1.375) - 200.0).abs() < 1e-3);
    // Between the last texel and the first.
    assert!((at(Wrap::Repeat, 1.0) - 125.0).abs() < 1e-3);
    for bad in [f32::NAN, f32::INFINITY, 1e38, -1e38] {
        assert!(at(Wrap::Repeat, bad).is_finite());
    }
}

#[test]
fn srgb_decodes_colours_but_not_opacity() {
    let t = Texture {
        srgb: true,
        ..Texture::rgba(1, 1, [[188, 0, 255, 128]])
    };
    let [r, g, b, a] = t.sample(Vec2::ZERO);
    // IEC 61966-2-1: code 188 is 0.5029.
    assert!((r - 0.502_886).abs() < 1e-5 && g == 0.0 && b == 1.0);
    assert!((a - 128.0 / 255.0).abs() < 1e-6);
}

#[test]
fn texels_of_all_depths_and_channels_have_the_values_of_eight_bits_and_four() {
    let rgba: Vec<[u8; 4]> = (0..12).map(|i| [20 * i, 255 - i, 90, 7 * i]).collect();
    for srgb in [false, true] {
        let whole = Texture {
            srgb,
            ..Texture::rgba(4, 3, rgba.iter().copied())
        };
        for channels in 1..=4u8 {
            // Grey is the red channel; missing opacity is 1.
            let kept: &[usize] =
                [&[0][..], &[0, 3], &[0, 1, 2], &[0, 1, 2, 3]][usize::from(channels) - 1];
            let codes = || rgba.iter().flat_map(|t| kept.iter().map(|&i| t[i]));
            let wide = codes().map(|c| 257 * u16::from(c)).collect();
            for texels in [Texels::Byte(codes().collect()), Texels::Word(wide)] {
                let part = Texture {
                    channels,
                    texels,
                    ..whole.clone()
                };
                for k in 0..100u32 {
                    let uv = Vec2::new(k as f32 * 0.37, k as f32 * 0.113 - 2.0);
                    let (found, mut expected) = (part.sample(uv), whole.sample(uv));
                    if channels < 3 {
                        expected = [expected[0], expected[0], expected[0], expected[3]];
                    }
                    if channels % 2 == 1 {
                        expected[3] = 1.0;
                    }
                    for (f, e) in found.iter().zip(expected) {
                        assert!((f - e).abs() < 1e-6, "{channels}: {found:?}, {expected:?}");
                    }
                }
                assert_eq!(part.sample(Vec2::new(0.375, 0.5)), part.texel(1, 1));
            }
        }
    }
}

#[test]
fn copies_of_a_repeated_image_are_alike() {
    for wrap in [Wrap::Repeat, Wrap::Mirror] {
        let t = ramp(wrap);
        for k in 0..64 {
            let u = k as f32 / 64.0;
            let at = |u: f32| t.sample(Vec2::new(u, 0.5));
            assert_eq!(at(u), at(u + 2.0));
            assert_eq!(at(u), at(u - 6.0));
        }
    }
}

#[test]
fn footprints_below_a_texel_change_no_bit_and_large_ones_show_the_mean() {
    let rgba = (0..64u32).map(|i| [(i * 37 % 256) as u8, (i * 91 % 256) as u8, 40, 255]);
    let mut t = Texture {
        srgb: true,
        ..Texture::rgba(8, 8, rgba)
    };
    t.build_mips();
    let uv = |k: u32| Vec2::new(k as f32 * 0.21, k as f32 * 0.43);
    for k in 0..50 {
        let axes = [Vec2::new(0.12, 0.0), Vec2::new(0.0, 0.125)];
        assert_eq!(
            t.sample_over(uv(k), axes),
            t.sample(uv(k)),
            "no larger than a texel"
        );
        let huge = t.sample_over(uv(k), [Vec2::X * 9.0, Vec2::Y * 7.0]);
        for (h, a) in huge.iter().zip(t.average()) {
            assert!((h - a).abs() < 2e-3, "{huge:?}");
        }
        // A footprint along a row of texels: the blur is only along the row.
        let row = t.sample_over(uv(k), [Vec2::X * 0.5, Vec2::Y * 0.01]);
        let at = |i: u32| t.sample(uv(k) + Vec2::X * (0.25 * i as f32 - 0.375));
        let mean = (0..4).map(|i| at(i)[0]).sum::<f32>() / 4.0;
        assert!((row[0] - mean).abs() < 1e-5, "{row:?}, {mean}");
        for bad in [f32::NAN, f32::INFINITY, 1e38] {
            let axes = [Vec2::splat(bad), Vec2::Y];
            assert!(
                t.sample_over(uv(k), axes)
                    .iter()
                    .all(|x| (0.0..=1.0).contains(x))
            );
        }
    }
}
