//! The report: the page is self-contained, and depends only on the results.

use opsr::render::value::TableChoice;
use opsr_lab::report::bench::Suite;
use opsr_lab::report::bench::overall::{best_constant, overall};
use opsr_lab::report::bench::page::page;
use opsr_lab::report::bench::results::Results;
use opsr_lab::stats::ratios::Verdict;

use super::planted::{Planted, planted, recorded};

fn methods() -> [Planted; 4] {
    [
        planted("plain", 0.1, 0.0),
        planted("twin & <co>", 0.1, 0.0),
        Planted {
            energy: 1.02,
            ..planted("bright", 0.05, 4e-4)
        },
        planted("loud", 0.2, 0.0),
    ]
}

#[test]
fn bench_page_determinism_and_self_contained() {
    let results = recorded(&methods(), 6);
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("results.json");
    results.save(&path).unwrap();
    let html = page(&results);
    let again = page(&Results::load(&path).unwrap());
    assert!(html == again, "two pages of one file");
    // Nothing is loaded and no scripts run.
    for foreign in ["http://", "https://", "<script", "<link", "@import"] {
        let html = html.replace("http://www.w3.org/2000/svg", "");
        assert!(!html.contains(foreign), "{foreign}");
    }
    // Names are text, not markup.
    assert!(html.contains("twin &amp; &lt;co&gt;") && !html.contains("<co>"));
    assert!(html.contains("planted &lt;scene&gt;") && html.contains("a &lt;processor&gt;"));
    assert!(html.contains("opsr bench suite.toml"));
}

#[test]
fn bench_page_shows_the_measurements() {
    let html = page(&recorded(&methods(), 6));
    // Curves over time and over samples, ratios over all scenes; a polyline or path for each method.
    assert_eq!(html.matches("<svg").count(), 3);
    for word in ["seconds", "samples per pixel", "relMSE"] {
        assert!(html.contains(word), "{word}");
    }
    // A picture and a map for each method, a reference in the style and as a picture.
    assert_eq!(html.matches("data:image/png;base64,").count(), 2 * 4 + 2);
    assert!(html.contains("better") && html.contains("worse") && html.contains(" tie"));
    assert!(html.contains("12.5 %"), "regularised share");
    // The method `bright` is too bright, has a floor, and is overtaken at some time.
    assert!(html.contains(" off") && html.contains("≈ "));
    assert!(html.contains("Where methods lose"));
    // Every second piece is an attribute, which may be a picture.
    let texts: String = html.split('"').step_by(2).collect();
    assert!(!texts.contains("NaN") && !texts.contains(">inf"));
}

#[test]
fn bench_page_of_partial_results() {
    let mut results = recorded(&methods()[..1], 1);
    results.insets.clear();
    results.products.clear();
    results.suite.times.clear();
    results.cells[0].points.truncate(2);
    let html = page(&results);
    assert!(!html.contains("data:image/png"));
    results.cells.clear();
    assert!(page(&results).contains("Speed against error"));
}

/// The planted scene twice, in two groups, with two methods that are constants.
fn two_scenes() -> Results {
    let mut results = recorded(&methods(), 6);
    let mut second = results.suite.scenes[0].clone();
    second.name = "second".into();
    second.group = Some("validation".into());
    results.suite.scenes[0].group = Some("training".into());
    results.suite.scenes.push(second);
    let cells: Vec<_> = results.cells.clone();
    for mut cell in cells {
        cell.scene = "second".into();
        // In the second scene the method `loud` is quiet.
        if cell.method == "loud" {
            for point in &mut cell.points {
                point.errors.values_mut().for_each(|e| *e *= 0.25);
            }
        }
        results.cells.push(cell);
    }
    for (method, gamma) in [(2, 0.1), (3, 0.2)] {
        results.suite.methods[method].spec.table = Some(TableChoice::Factor(gamma));
    }
    results
}

#[test]
fn bench_overall_by_group_and_opponent() {
    let results = two_scenes();
    let of = |group, opponent: &str, name: &str| {
        let all = overall(&results, group, opponent);
        all.standings.into_iter().find(|s| s.name == name).unwrap()
    };
    let ratio = |group, name: &str| of(group, "plain", name).ratios[0].unwrap();
    // Twice the error in one scene and half in the other: no difference over both.
    assert_eq!(ratio(None, "loud").1, Verdict::Tie);
    assert!((ratio(None, "loud").0.value - 1.0).abs() < 0.02);
    assert_eq!(ratio(Some("training"), "loud").1, Verdict::Worse);
    assert!(ratio(Some("validation"), "loud").0.holds(0.5));
    assert_eq!(of(None, "plain", "loud").tally, [1, 0, 1]);
    assert_eq!(of(None, "plain", "bright").tally, [2, 0, 0]);
    assert_eq!(best_constant(&results), Some("bright"));
    let twin = of(None, "bright", "twin & <co>").ratios[0].unwrap();
    assert_eq!(twin.1, Verdict::Worse);
    let html = page(&results);
    assert!(html.contains("Against bright: validation, 1 scene"));
    // Groups are in the suite's file, but not in the key of a run.
    let text = toml::to_string(&results.suite).unwrap();
    assert_eq!(Suite::parse(&text).unwrap(), results.suite);
}
