use super::*;
use opsr::math::Rgb;

fn still(light: f32) -> StoredFrame {
    StoredFrame {
        picture: Buffer::filled(2, 2, Rgb::splat(light)),
        round: 0,
        samples: 2,
        command: String::new(),
    }
}

fn film(seconds: f64, frame: UVec2) -> Film {
    Film::new(1, String::new(), pace(seconds), frame, false)
}

/// Frames cover one loop, and their size lets all of them fit into memory.
#[test]
fn frames_of_long_films_are_smaller() {
    assert_eq!(
        [0.0, 0.5, 2.0, 2.01].map(pace),
        [1, 12, 48, 49].map(|count| (count, 24.0))
    );
    assert_eq!(pace(200.0), (2400, 12.0));
    assert!(pace(1e9).0 <= MAX_FRAMES as usize && pace(1e9).1 > 0.0);
    assert_eq!(seconds(Moment::Seconds(0.5)), 0.5);
    assert_eq!(seconds(Moment::Frame(10.0, 20.0)), 0.5);
    let frame = UVec2::new(640, 480);
    for (seconds, scale) in [(2.0, 1), (10.0, 2), (90.0, 4), (1e5, 6)] {
        let film = film(seconds, frame);
        assert_eq!(film.scale, scale, "{seconds}");
        let pixels = (frame / scale).as_dvec2().element_product();
        assert!(BYTES_OF_PIXEL * pixels * film.len() as f64 <= MAX_BYTES);
    }
}

/// Missing frames are found in the order of the clock, past the end of the loop too. Changes come once, oldest first.
#[test]
fn missing_frames_come_in_the_order_of_the_clock() {
    let mut film = film(0.25, UVec2::ONE);
    let mut order = Vec::new();
    let mut from = 2.5;
    while let Some(number) = film.first_missing(from / RATE) {
        film.store(number, still(1.0));
        order.push(number);
        from = number as f64 + 1.5;
    }
    assert_eq!(order, [3, 5, 1, 4, 0, 2]);
    assert_eq!(
        (film.first_before(0), film.first_before(1)),
        (None, Some(0))
    );
    film.store(5, still(2.0));
    let (mut change, mut given) = (0, Vec::new());
    while let Some((number, frame, _)) = film.after(change) {
        assert!(number > change && film.is_newer(change));
        (change, given) = (number, [given, vec![frame]].concat());
    }
    assert_eq!(given, [3, 1, 4, 0, 2, 5]);
    assert!(!film.is_newer(change));
    film.repaint();
    assert!(film.after(change).is_some_and(|(_, frame, _)| frame == 0));
}

/// The first frame that is shown sets the exposure of all, until it is chosen anew.
#[test]
fn exposure_stays_through_a_film() {
    let mut film = film(1.0, UVec2::ONE);
    let spec = Spec::default();
    let shown = |film: &mut Film, light| film.display(&spec, &still(light).picture).exposure;
    let first = shown(&mut film, 1.0);
    assert_eq!(shown(&mut film, 64.0), first);
    film.repaint();
    assert!(shown(&mut film, 64.0) < first);
}
