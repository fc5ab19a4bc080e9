use super::*;
use crate::open_scene::OpenScene;
use opsr::integrator::Amounts;
use opsr::integrator::{Recorded, View};
use opsr::math::UVec2;

/// The path tracer finds a quarter of the sun's light on a pool. The witness reports this for this render alone, and
/// the missing light is part of the error and has a map.
#[test]
fn missing_light_is_shown() {
    missing_light_is_shown_at(Amounts::Raw);
    missing_light_is_shown_at(Amounts::Blurred);
}

/// A render of a pool under the sun with these samples.
fn job(amounts: Amounts, samples: u32) -> Job {
    let open_scene = Arc::new(OpenScene::sun_pool());
    let camera = open_scene.opened.scene.parts().cameras[0].clone();
    let size = UVec2::splat(40);
    let settings = Settings {
        amounts,
        ..Settings::default()
    };
    let viewpoint = Arc::new(Viewpoint::new(open_scene, camera, size, &settings));
    let view: View<'_> = viewpoint.view(size);
    let mut picture =
        Picture::blank(size, view.window, &settings.amounts, Recorded::default()).expect("a film");
    settings.integrator().pass(&view, 0..samples, &mut picture);
    Job {
        side: 0,
        run: 3,
        viewpoint: viewpoint.clone(),
        settings,
        picture,
        samples,
        seconds: 1.0,
        over: Arc::default(),
    }
}

const ALONE: Comparison = Comparison {
    picture: None,
    reference: None,
    shown: false,
};

fn missing_light_is_shown_at(amounts: Amounts) {
    let job = job(amounts, 400);
    let mut witness = Witness::default();
    let spec = Spec::default();
    assert!(witness.is_due(&job, &spec) && witness.look(&job));
    assert!(!witness.is_due(&job, &spec));
    assert!(witness.of(2).is_none());
    let missing = witness.of(3).expect("light is missing");
    let made = |missing| {
        finished(&job, &spec, &ALONE, missing)
            .expect("a picture")
            .maps
    };
    let (with, without) = (made(Some(missing)), made(None));
    assert!(without.missing.is_none() && with.stated > without.stated);
    let map = with.missing.expect("a map");
    let lacking = map.iter().filter(|&&share| share > 0.1).count();
    assert!(lacking > 100 && map.iter().all(|&share| (0.0..=1.0).contains(&share)));
    // The witness skips a render that has ended.
    job.over.store(true, Ordering::Relaxed);
    assert!(!witness.look(&job));
}
