use super::*;

fn read<T: Field>(text: &str) -> Result<T, String> {
    T::read(&text.into(), &Range::FINITE)
}

#[test]
fn crop_shares_tile_the_frame() {
    let frame = UVec2::new(101, 67);
    let of = |text: &str| read::<Crop>(text).unwrap().of(frame);
    assert_eq!(of("0,0,100%,1.0"), Window::full(frame));
    let thirds = ["0%", "1/3", "2/3"].map(|x| of(&format!("{x},0,1/3,67")));
    assert_eq!(thirds.iter().map(|w| w.w).sum::<u32>(), 101);
    assert!(thirds.windows(2).all(|w| w[0].x + w[0].w == w[1].x));
    assert_eq!(
        of("10,20,32,32"),
        Window {
            x: 10,
            y: 20,
            w: 32,
            h: 32
        }
    );
    for bad in ["1,2,3", "a,0,1,1", "-1%,0,1,1", "1/0,0,1,1", "0,0,inf%,1"] {
        assert!(read::<Crop>(bad).is_err(), "{bad}");
    }
}

#[test]
fn lens_has_a_radius_and_a_distance() {
    let lens = |radius, focus| Ok(LensChoice { radius, focus });
    assert_eq!(read("0.5,3"), lens(0.5, Some(3.0)));
    assert_eq!(read("0.5"), lens(0.5, None));
    assert_eq!(LensChoice::read(&0.into(), &Range::FINITE), lens(0.0, None));
    for bad in ["0,3", "-1", "1,0", "1,-2", "1,2,3", "x", "1e99", ""] {
        assert!(read::<LensChoice>(bad).is_err(), "{bad}");
    }
}

#[test]
fn size_in_pixels_or_as_a_share() {
    assert_eq!(read("640x480"), Ok(Size::Pixels(UVec2::new(640, 480))));
    let list = serde_json::json!([640, 480]);
    assert_eq!(Size::read(&list, &Range::FINITE), read("640x480"));
    for half in ["50%", "1/2", "0.5"] {
        assert_eq!(read(half), Ok(Size::Share(0.5)));
    }
    for bad in ["0x5", "2", "0%", "640", "-50%", "x", "70000x1"] {
        assert!(read::<Size>(bad).is_err(), "{bad}");
    }
}
