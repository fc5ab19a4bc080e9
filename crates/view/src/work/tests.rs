use super::*;
use crate::finish::Slot;
use crate::preview::settings;
use crate::scene_file::SceneFile;
use opsr::integrator::{Estimator, Recorded};
use serde_json::{Value, json};
use std::path::Path;

const FRAME: UVec2 = UVec2::new(40, 30);

/// Calls `then` with a renderer and a request of these options that has not begun.
fn with(
    choices: &[(&str, Value)],
    then: impl FnOnce(&mut Renderer<'_>, Request<'_>, &Arc<Viewpoint>),
) {
    let mut spec = Spec::default();
    let size = json!(format!("{}x{}", FRAME.x, FRAME.y));
    for (name, value) in [("size", size)].iter().chain(choices) {
        spec.set(name, value).expect("an option");
    }
    let open_scene = Arc::new(OpenScene::sun_pool());
    let subject = Subject {
        scene: &open_scene.opened.scene,
        name: "",
        sha256: "",
        in_studio: false,
    };
    let request = Request::new(&spec, subject, None).expect("a request");
    let viewpoint = Viewpoint::new(
        open_scene.clone(),
        request.camera.clone(),
        request.frame,
        &request.settings,
    );
    let file = Arc::new(SceneFile::named(Path::new("")));
    let hub = Hub::new(Options::new(&spec, file, false).expect("options"), None);
    let mut renderer = Renderer {
        hub: &hub,
        slot: &Slot::default(),
        previews: Previews::default(),
        choices: HashMap::new(),
    };
    then(&mut renderer, request, &Arc::new(viewpoint));
}

/// Previews are resolved, by the method of the render if that needs no work before its first sample; the last preview
/// has half of the frame's rows.
#[test]
fn young_pictures_are_resolved() {
    let cases = [
        (vec![("integrator", json!("vcm"))], "vcm"),
        (vec![("table", json!(0.3))], "path"),
        (vec![("integrator", json!("mlt"))], "path"),
        (vec![], "path"),
    ];
    for (choices, method) in cases {
        with(&choices, |renderer, request, viewpoint| {
            let settings = settings(&request, &viewpoint.settings);
            let is_path = settings.estimator == Estimator::default();
            assert_eq!(is_path, method == "path", "{choices:?}");
            renderer.previews.cost = Some((settings.estimator, 1.0));
            let all = renderer
                .previews
                .show(renderer.hub, &request, viewpoint, 0, None);
            assert!(all.expect("pictures"));
            let size = FRAME / LAST_SCALE;
            let view = viewpoint.view(size);
            let blank = Picture::blank(size, view.window, &settings.amounts, Recorded::default());
            let mut expected = blank.expect("a film");
            settings.integrator().pass(&view, 0..8, &mut expected);
            let raw = expected.film.mean();
            let expected = request.spec.shown(&expected);
            let shown = renderer.hub.lock().shown.clone().expect("a picture");
            assert!(shown.preview && shown.size == size, "{choices:?}");
            assert!(shown.picture == expected && expected != raw, "{choices:?}");
        });
    }
}

/// A fast frame has one preview, or none after the choice of a method; a slow frame begins with few pixels.
#[test]
fn pictures_of_fewer_pixels_are_few_where_frames_are_fast() {
    with(
        &[("integrator", json!("path"))],
        |renderer, request, viewpoint| {
            let mut size_after = |cost: f64, coarsest| {
                renderer.previews.cost = Some((Estimator::default(), cost));
                renderer.hub.change(|state| state.shown = None);
                let all = renderer
                    .previews
                    .show(renderer.hub, &request, viewpoint, 0, coarsest);
                assert!(all.expect("pictures"));
                renderer.hub.lock().shown.clone().map(|shown| shown.size)
            };
            assert_eq!(size_after(1e-12, None), Some(FRAME));
            assert_eq!(size_after(1e-12, Some(LAST_SCALE)), None);
            assert_eq!(size_after(1.0, Some(LAST_SCALE)), Some(FRAME / LAST_SCALE));
        },
    );
}

/// The first sample of a whole frame is not shown by itself, unless it is the last.
#[test]
fn first_sample_of_a_frame_waits_for_the_second() {
    with(
        &[("integrator", json!("path"))],
        |renderer, request, viewpoint| {
            let amounts = &request.settings.amounts;
            let blank = Picture::blank(FRAME, request.window, amounts, Recorded::default());
            let mut run = Run::new(request, blank.expect("a film"), Arc::default());
            for (samples, last, offered) in [(1, false, false), (2, false, true), (1, true, true)] {
                (run.samples, run.shown, run.offered) = (samples, 0, None);
                renderer.offer(&mut run, 0, viewpoint, 0, last);
                let is_offered = renderer.slot.cost().is_none();
                assert_eq!(is_offered, offered, "{samples}, {last}");
                renderer.slot.take();
                renderer.slot.done(0.0);
            }
        },
    );
}
