//! Benches: suites, resumed runs, and verdicts on recorded data.

pub(crate) mod planted;
mod report;

use crate::support::root;
use std::ops::ControlFlow;
use std::path::Path;

use opsr::image::{Buffer, exr};
use opsr::math::Rgb;
use opsr::render::value::TableChoice;
use opsr_lab::report::bench::curve::Crossing;
use opsr_lab::report::bench::results::Results;
use opsr_lab::report::bench::summary::{self, MethodSummary};
use opsr_lab::report::bench::{Outcome, Suite, run};
use opsr_lab::stats::ratios::Verdict;
use planted::{Planted, planted, recorded};

fn summary_of<'a>(all: &'a [summary::SceneSummary], name: &str) -> &'a MethodSummary {
    all[0].methods.iter().find(|m| m.name == name).unwrap()
}

#[test]
fn bench_finds_planted_differences_and_no_others() {
    let methods = [
        planted("plain", 0.1, 0.0),
        planted("twin", 0.1, 0.0),
        planted("quiet", 0.05, 0.0),
        Planted {
            energy: 1.02,
            ..planted("bright", 0.05, 4e-4)
        },
        Planted {
            cost: 1.3e-3,
            ..planted("slow", 0.1, 0.0)
        },
    ];
    let all = summary::summaries(&recorded(&methods, 8));
    let verdict = |name: &str| summary_of(&all, name).metrics[0].1.unwrap().ratio.unwrap();
    let speed = |name: &str| summary_of(&all, name).ns_per_path.unwrap().ratio.unwrap();
    assert_eq!(verdict("twin").1, Verdict::Tie);
    assert_eq!(speed("twin").1, Verdict::Tie);
    assert_eq!(verdict("quiet").1, Verdict::Better);
    assert!(verdict("quiet").0.holds(0.5));
    assert_eq!(speed("slow").1, Verdict::Worse);
    let (ratio, _) = speed("slow");
    assert!(ratio.holds(1.3) && ratio.low > 1.2, "{ratio:?}");
    for name in ["plain", "twin", "quiet", "slow"] {
        let m = summary_of(&all, name);
        assert!(
            !m.energy_is_off() && m.floor().is_none(),
            "{name}: {:?} {:?}",
            m.energy,
            m.squared_bias
        );
    }
    let bright = summary_of(&all, "bright");
    assert!(bright.energy_is_off() && bright.energy.unwrap().holds(1.02));
    let floor = bright.floor().unwrap();
    // The floor 0.02² f²/(f² + 0.01), for f near ½.
    assert!((floor / 3.84e-4 - 1.0).abs() < 0.25, "{floor}");
    assert!(matches!(
        bright.crossing,
        Some(Crossing::Extrapolated(t)) if t > 20.0
    ));
    // A tie crosses by chance only; a quieter method without bias is never overtaken.
    assert_eq!(summary_of(&all, "twin").crossing, Some(Crossing::Undecided));
    assert_eq!(
        summary_of(&all, "quiet").crossing,
        Some(Crossing::NotInSight)
    );
    let plain = summary_of(&all, "plain");
    assert!(plain.crossing.is_none() && plain.metrics[0].1.unwrap().ratio.is_none());
}

#[test]
fn bench_verdict_needs_five_seeds() {
    let all = summary::summaries(&recorded(
        &[planted("plain", 0.1, 0.0), planted("quiet", 0.01, 0.0)],
        4,
    ));
    let ratio = summary_of(&all, "quiet").metrics[0]
        .1
        .unwrap()
        .ratio
        .unwrap();
    assert_eq!(ratio.1, Verdict::TooFewSeeds);
}

#[test]
fn bench_suite_errors_name_the_entry() {
    let scene = "[[scene]]\nname = 's'\nbuiltin = 'plane'\nsize = [8, 8]\nreference_spp = 1\n";
    let method = "[[method]]\nname = 'm'\n";
    let faults = [
        (format!("{scene}{method}"), "time point"),
        (format!("times = [2, 1]\n{scene}{method}"), "ascending"),
        (format!("times = [1]\nspeed = 3\n{scene}{method}"), "speed"),
        (
            format!("times = [1]\nbaseline = 'x'\n{scene}{method}"),
            "`x`",
        ),
        (format!("times = [1]\n{scene}{scene}{method}"), "two scenes"),
        (
            format!("times = [1]\n{scene}crop = [4, 4, 8, 8]\n{method}"),
            "scene `s`: crop",
        ),
        (
            format!("times = [1]\n{scene}reference = 'r.exr'\n{method}"),
            "either",
        ),
        (
            format!("times = [1]\n{scene}{method}table = 2.0\n"),
            "method `m`: table",
        ),
        (
            format!("times = [1]\n{scene}{method}method = 'plain'\n"),
            "method `m`: there is no option `method`",
        ),
        (
            format!(
                "times = [1]\n{scene}[[method]]\nname = 'm'\ntable = 'beta-0.001'\ntable_scale = 0\n"
            ),
            "table_scale: expected a number above 0",
        ),
        (
            format!("times = [1]\n{scene}max_vertices = 0\n{method}"),
            "max_vertices",
        ),
    ];
    for (text, word) in faults {
        let error = Suite::parse(&text).unwrap_err();
        assert!(error.contains(word), "{text}\n{error}");
    }
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("suite.toml");
    let text =
        "times = [1]\n[[scene]]\nname = 's'\nfile = 'a.glb'\nsize = [8, 8]\nreference = '/r.exr'\n";
    std::fs::write(&path, format!("{text}{method}")).unwrap();
    let suite = Suite::load(&path).unwrap();
    assert_eq!(
        suite.scenes[0].file.as_deref(),
        Some(&*folder.path().join("a.glb"))
    );
    assert_eq!(
        suite.scenes[0].reference.as_deref(),
        Some(Path::new("/r.exr"))
    );
}

const SMALL: &str = "seeds = 3\nsamples = [2, 5]\n\
    [[scene]]\nname = 'box'\nbuiltin = 'caustic-box'\nsize = [24, 16]\ncrop = [4, 0, 16, 16]\nreference_spp = 16\n\
    [[method]]\nname = 'plain'\n\
    [[method]]\nname = 'twin'\ntable = 0.0\n";

#[test]
fn bench_resume_keeps_measured_runs() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("results.json");
    let suite = Suite::parse(SMALL).unwrap();
    let go = |suite: &Suite, stop_at: usize| {
        let mut heard = |s: &opsr_lab::report::bench::Status| {
            if s.done >= stop_at {
                ControlFlow::Break(())
            } else {
                ControlFlow::Continue(())
            }
        };
        run(suite, &path, "opsr bench", &mut heard).unwrap()
    };
    let (first, outcome) = go(&suite, 3);
    assert_eq!((outcome, first.cells.len()), (Outcome::Stopped, 3));
    assert_eq!(
        Results::load(&path).unwrap(),
        first,
        "the file is what was returned"
    );

    let (all, outcome) = go(&suite, usize::MAX);
    assert_eq!((outcome, all.cells.len()), (Outcome::Done, 6));
    assert_eq!(all.cells[..3], first.cells[..], "kept to the bit");
    assert_eq!(Results::load(&path).unwrap(), all);
    assert_eq!(all.products.len(), 2);
    assert_eq!(all.insets.len(), 3);
    let samples: Vec<u32> = all.cells[0].points.iter().map(|p| p.samples).collect();
    assert_eq!(samples, [1, 2, 5]);
    assert_eq!(all.cells[0].paths, 5 * 256);

    // A table of zeros is bit-identical to plain path tracing, and so is its error.
    let scenes = summary::summaries(&all);
    let (ratio, verdict) = summary_of(&scenes, "twin").metrics[0]
        .1
        .unwrap()
        .ratio
        .unwrap();
    assert_eq!(
        (ratio.low, ratio.high, verdict),
        (1.0, 1.0, Verdict::TooFewSeeds)
    );
    // The diagonal of the products is relMSE itself.
    let products = all.products("box", "plain").unwrap();
    for (run, row) in all.runs("box", "plain").iter().zip(0..) {
        let error = run.points.last().unwrap().errors["relMSE"];
        assert!((products.values[row][row] / error - 1.0).abs() < 1e-4);
    }

    // Nothing is measured twice, a further method adds only its own runs, and a new time point repeats all runs.
    let (again, _) = go(&suite, usize::MAX);
    assert_eq!(again, all);
    let more = Suite::parse(&format!(
        "{SMALL}[[method]]\nname = 'pbrt'\nmode = 'pbrt'\n"
    ))
    .unwrap();
    let (more, _) = go(&more, usize::MAX);
    assert_eq!(more.cells.len(), 9);
    assert_eq!(more.cells[..6], all.cells[..]);
    let longer = Suite::parse(&SMALL.replace("[2, 5]", "[2, 6]")).unwrap();
    let (longer, _) = go(&longer, usize::MAX);
    assert!(
        longer
            .runs("box", "plain")
            .iter()
            .all(|c| c.points.last().unwrap().samples == 6)
    );
}

/// Levels and pilots are measured as in a render, with the time that they take.
#[test]
fn bench_measures_levels_pilots_and_environments() {
    let folder = tempfile::tempdir().unwrap();
    let write = |name: &str, bytes: &[u8]| std::fs::write(folder.path().join(name), bytes).unwrap();
    write("table.json", &crate::fuzz::seeds::tables()[1]);
    write("sky.hdr", &crate::fuzz::seeds::hdr()[0]);
    let go = |scene: &str| {
        let text = format!(
            "samples = [1, 8]\nseeds = 1\n\
             [[scene]]\nname = 'box'\nbuiltin = 'caustic-box'\nsize = [64, 32]\nreference_spp = 16\n{scene}\n\
             [[method]]\nname = 'plain'\n\
             [[method]]\nname = 'levels'\ntable = 0.3\nlevels = [0.0, 0.3, 3.0]\n\
             [[method]]\nname = 'sharp'\ntable = 0.3\nlevels = [0.0, 0.3, 3.0]\nresolve = 'sharp'\n\
             [[method]]\nname = 'pilot'\ntable = 'table.json'\nintegrator = 'auto'\n"
        );
        write("suite.toml", text.as_bytes());
        let suite = Suite::load(&folder.path().join("suite.toml")).unwrap();
        let path = folder.path().join("results.json");
        let (results, _) = run(&suite, &path, "", &mut |_| ControlFlow::Continue(())).unwrap();
        results
    };
    let results = go("");
    let last = |results: &Results, method: &str| {
        let run = results.runs("box", method)[0];
        run.points.last().unwrap().clone()
    };
    let [plain, levels, sharp, pilot] =
        ["plain", "levels", "sharp", "pilot"].map(|m| last(&results, m));
    assert!(levels.errors["relMSE"] < plain.errors["relMSE"]);
    assert!(levels.errors != sharp.errors);
    let ratio = levels.errors["error map ratio"];
    assert!(ratio > 0.1 && ratio < 10.0, "{ratio}");
    assert!(levels.errors["error map rank"].abs() <= 1.0);
    assert!(!plain.errors.contains_key("error map ratio"));
    assert!(pilot.errors != plain.errors);
    // A pilot's time is in every point; methods without a pilot have none.
    let [piloted, alone] = ["pilot", "plain"].map(|m| results.runs("box", m)[0]);
    assert!(piloted.pilot > 0.0 && alone.pilot == 0.0);
    assert!(piloted.points.iter().all(|p| p.cpu > 0.999 * piloted.pilot));
    let text = serde_json::to_string(alone).unwrap();
    assert!(!text.contains("\"pilot\":"), "{text}");
    let text = summary::text(&results);
    assert!(text.contains("error map"), "{text}");
    // Another sky is another scene: everything is measured again.
    let lit = go("environment = 'sky.hdr'");
    assert_ne!(lit.scenes[0].source, results.scenes[0].source);
    assert!(last(&lit, "plain").errors != plain.errors);
}

#[test]
fn bench_references_are_cached_or_given() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("results.json");
    let quick = SMALL.replace("seeds = 3", "seeds = 1");
    let go = |text: &str| {
        run(&Suite::parse(text).unwrap(), &path, "", &mut |_| {
            ControlFlow::Continue(())
        })
    };
    let (made, _) = go(&quick).unwrap();
    let reference = made.inset("box", None).unwrap().picture().unwrap();
    let kept: Vec<_> = std::fs::read_dir(folder.path().join("results.pictures"))
        .unwrap()
        .map(|f| f.unwrap().path())
        .filter(|p| p.display().to_string().contains("reference-"))
        .collect();
    assert_eq!(kept.len(), 1);
    assert!(made.scenes[0].reference_noise > 0.0);
    let given = |file: &Path| {
        quick.replace(
            "reference_spp = 16",
            &format!("reference = '{}'", file.display()),
        )
    };
    let (same, _) = go(&given(&kept[0])).unwrap();
    assert_eq!(
        same.scenes[0].reference_noise,
        made.scenes[0].reference_noise
    );
    assert_eq!(
        same.inset("box", None).unwrap().picture().unwrap(),
        reference
    );
    // A picture of the whole frame is cut to the crop; a picture of another size is an error.
    let whole = folder.path().join("whole.exr");
    let picture = Buffer::from_fn(24, 16, |x, _| Rgb::splat(x as f32));
    exr::write_rgb(&whole, &picture, &exr::Metadata::new()).unwrap();
    let (cut, _) = go(&given(&whole)).unwrap();
    assert_eq!(
        cut.inset("box", None).unwrap().picture().unwrap().pixels[0],
        Rgb::splat(4.0)
    );
    exr::write_rgb(
        &whole,
        &Buffer::filled(3, 3, Rgb::ONE),
        &exr::Metadata::new(),
    )
    .unwrap();
    let error = go(&given(&whole)).unwrap_err().to_string();
    assert!(
        error.contains("whole.exr") && error.contains("3x3"),
        "{error}"
    );
}

#[test]
fn bench_convergence_of_plain_errors_is_one_over_samples() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("results.json");
    let text = "seeds = 3\nsamples = [4, 256]\n\
        [[scene]]\nname = 's'\nbuiltin = 'plane'\nsize = [16, 16]\nreference_spp = 16384\n\
        [[method]]\nname = 'plain'\n\
        [[method]]\nname = 'again'\n";
    let suite = Suite::parse(text).unwrap();
    let (results, _) = run(&suite, &path, "", &mut |_| ControlFlow::Continue(())).unwrap();
    let all = summary::summaries(&results);
    let main = |name: &str| {
        let of = summary_of(&all, name);
        [0, 1].map(|i| of.main[i].1.unwrap().value)
    };
    let [few, many] = main("plain");
    let slope = (many / few).ln() / (256f64 / 4.0).ln();
    assert!((slope + 1.0).abs() < 0.05, "{slope}");
    // The same method under another name has its own runs with equal errors.
    assert_eq!(results.cells.len(), 6);
    assert_eq!(main("again"), [few, many]);
}

#[test]
fn bench_committed_suites_name_existing_files() {
    let root = root();
    for name in ["quick", "full", "frames", "denoised", "media"] {
        let suite = Suite::load(&root.join(format!("suites/{name}.toml"))).unwrap();
        let short = ["frames", "denoised", "media"].contains(&name);
        assert!(suite.seeds >= 5 || short, "{name}: no verdicts");
        for scene in &suite.scenes {
            for file in [&scene.file, &scene.reference].into_iter().flatten() {
                assert!(file.exists(), "{name}: {}", file.display());
            }
        }
        // If crops and depths change in the manifest, the suites must follow.
        let path = root.join("training_scenes/manifest.toml");
        let manifest = opsr_train::manifest::Manifest::load(&path).unwrap();
        for scene in suite.scenes.iter().filter(|s| s.reference.is_some()) {
            let example = manifest
                .scenes
                .iter()
                .find(|e| scene.name.starts_with(&e.name))
                .unwrap();
            let [x, y, w, h] = scene.crop.unwrap();
            assert!(
                example.crops.contains(&[x, y]) && (w, h) == (32, 32),
                "{}",
                scene.name
            );
            assert_eq!(
                (scene.size, scene.max_vertices),
                (example.frame, example.max_vertices)
            );
        }
    }
}

/// A suite may name a table of the program, as `opsr render --opsr-table` does; a file of that name takes precedence.
#[test]
fn table_of_a_suite_may_be_named() {
    let folder = crate::support::quick_folder();
    let path = folder.path().join("suite.toml");
    let method = "[[method]]\nname = 'learned'\ntable = 'beta-0.001'\n";
    std::fs::write(&path, format!("{SMALL}{method}")).unwrap();
    let table = || Suite::load(&path).unwrap().methods.pop().unwrap();
    let learned = table().spec;
    let named = |path: &Path| Some(TableChoice::File(path.to_owned()));
    assert_eq!(learned.table, named(Path::new("beta-0.001")));
    let mut loaded = learned.clone();
    loaded.load_table().unwrap();
    assert!(matches!(loaded.table, Some(TableChoice::Loaded(..))));
    std::fs::write(folder.path().join("beta-0.001"), "another").unwrap();
    assert_eq!(table().spec.table, named(&folder.path().join("beta-0.001")));
}

/// Bodies overlap, which manifold sampling does not support: its runs are marked, and the others are measured.
#[test]
fn bench_leaves_out_a_method_that_a_scene_refuses() {
    let folder = tempfile::tempdir().unwrap();
    let mut parts = opsr_lab::gallery::cornell_box();
    for (name, x) in [("a", 0.0), ("b", 0.2)] {
        let ball = opsr_lab::gallery::shapes::sphere(opsr::math::Vec3::new(x, 1.4, 0.0), 0.3, 3);
        parts.add(opsr_lab::gallery::materials::glass(name, 1.5, 0.0), [ball]);
    }
    opsr_lab::gallery::glb::save(&parts, &folder.path().join("balls.glb")).unwrap();
    let suite = folder.path().join("suite.toml");
    let text = "seeds = 2\nsamples = [2]\n\
        [[scene]]\nname = 'balls'\nfile = 'balls.glb'\nsize = [16, 16]\nreference_spp = 4\n\
        [[method]]\nname = 'chains'\nintegrator = 'manifold'\ntrials = 1\n\
        [[method]]\nname = 'plain'\n";
    std::fs::write(&suite, text).unwrap();
    let suite = Suite::load(&suite).unwrap();
    let path = folder.path().join("results.json");
    let mut heard = |_: &opsr_lab::report::bench::Status| ControlFlow::Continue(());
    let (results, outcome) = run(&suite, &path, "opsr bench", &mut heard).unwrap();
    assert_eq!(outcome, Outcome::Done);
    assert_eq!(results.runs("balls", "plain").len(), 2);
    assert_eq!(results.runs("balls", "chains").len(), 0);
    let [("chains", why)] = results.refused("balls")[..] else {
        panic!("{:?}", results.refused("balls"));
    };
    assert!(why.contains("overlap"), "{why}");
    // The reason is in the file, the table and the page.
    let results = Results::load(&path).unwrap();
    let text = summary::text(&results);
    assert!(
        text.contains("chains is left out: manifold knows no"),
        "{text}"
    );
    let page = opsr_lab::report::bench::page::page(&results);
    assert!(page.contains("is left out: manifold knows no"), "{page}");
}
