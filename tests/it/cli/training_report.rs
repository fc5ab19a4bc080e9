//! The report of a training: names of tables, scores, refused settings.

use super::TestFolder;
use opsr::regularise::Lookup;
use opsr::regularise::file::TableFile;
use opsr_lab::gallery;
use serde_json::Value;

/// Two families for training and one scene for validation, with one crop each.
const MANIFEST: &str = r#"
[[scene]]
name = "glass"
file = "box.glb"
role = "train"
family = "boxes"
frame = [64, 64]
crops = [[24, 32]]
max_vertices = 6
exposure = 1.0

[[scene]]
name = "walls"
file = "walls.glb"
role = "train"
family = "walls"
frame = [64, 64]
crops = [[16, 16]]
max_vertices = 6
exposure = 1.0

[[scene]]
name = "kept"
file = "box.glb"
role = "validation"
family = "kept"
frame = [64, 64]
crops = [[0, 32]]
max_vertices = 6
exposure = 1.0
"#;

/// A folder with the manifest and its scenes.
fn scenes() -> TestFolder {
    let place = TestFolder::new();
    place.save("box.glb", &gallery::caustic_box());
    place.save("walls.glb", &gallery::cornell_box());
    place.write("list.toml", MANIFEST);
    place
}

/// The same folder with references.
fn ready() -> TestFolder {
    let place = scenes();
    let message = place.opsr("scenes reference --manifest list.toml --spp 96 --threads 2");
    assert_eq!(message.done().out.lines().count(), 4);
    place
}

const QUICK: &str =
    "train --preset fast --set manifest=list.toml --spp 4 --set validate_every=2 --threads 2";

fn json(text: impl AsRef<[u8]>) -> Value {
    serde_json::from_slice(text.as_ref()).expect("JSON")
}

/// The report's page without its images.
fn page(place: &TestFolder) -> String {
    let page = String::from_utf8(place.read("run/report.html")).expect("UTF-8");
    let mut parts = page.split("base64,");
    let first = parts.next().unwrap_or_default().to_owned();
    parts.fold(first, |all, part| {
        let end = part.find('"').expect("the end of a picture");
        assert!(end > 80, "an empty picture");
        all + &part[end..]
    })
}

fn loss(scores: &Value, i: usize) -> f64 {
    scores[i]["loss"].as_f64().expect("a loss")
}

#[test]
fn report_scores_tables_beside_constants() {
    let place = ready();
    // Existing references are kept.
    let first = place.read("references/kept_0_32.exr");
    (place.opsr("scenes reference --manifest list.toml --spp 96")).done();
    assert!(place.read("references/kept_0_32.exr") == first);

    let args = "--steps 4 --beta 0.001,0.05 --progress json --run run --out tables";
    let ended = place.opsr(&format!("{QUICK} {args}")).done();
    let (report, recorded): (Vec<Value>, Vec<Value>) =
        (ended.out.lines().map(json)).partition(|line| line["recording"].is_null());
    assert!(!recorded.is_empty());
    assert_eq!(report.first().map(|t| &t["step"]), Some(&Value::from(0)));
    assert_eq!(report.last().map(|t| &t["step"]), Some(&Value::from(4)));
    assert!(report.iter().all(|t| t["validation"].is_number()));

    let report = json(place.read("run/report.json"));
    let page = page(&place);
    // Ink on the background of the page, dark or light.
    assert!(page.contains("fill=\"currentColor\"") && !page.contains("background: #fff"));
    for word in [
        "glass 24,32",
        "walls 16,16",
        "kept 0,32",
        "β = 0.001",
        "What the terms mean",
        "crops have a larger loss with the table than plain",
        "data:image/png",
    ] {
        assert!(page.contains(word), "{word}");
    }
    assert!(!page.contains("NaN"));
    for (i, beta) in ["0.001", "0.05"].into_iter().enumerate() {
        let path = place.path().join(format!("tables/fast-beta-{beta}.json"));
        let file = TableFile::load(&path).expect("a table");
        let about = file
            .provenance
            .as_ref()
            .expect("a table says where it is from");
        assert_eq!((about.steps, about.spp), (4, 4));
        let names: Vec<&str> = about.scenes.iter().map(|s| s.0.as_str()).collect();
        assert_eq!(names, ["glass", "walls"]);
        assert_eq!(
            about.visits,
            serde_json::from_value::<Vec<u64>>(report["visits"].clone()).unwrap()
        );

        let log =
            String::from_utf8(place.read(&format!("run/fast-beta-{beta}/metrics.jsonl"))).unwrap();
        let steps: Vec<u64> = (log.lines())
            .map(|l| json(l)["step"].as_u64().unwrap())
            .collect();
        assert_eq!(steps, [0, 2, 4]);

        // No constant is better than the best one, and a table is not much worse on its training crops.
        let learned = &report["tables"][i];
        let training = &learned["training"];
        assert_eq!(training[0]["name"], "best constant of these crops");
        assert!((loss(training, 0) - loss(training, 1)).abs() < 1e-6);
        assert!(loss(training, 2) <= loss(training, 0) * 1.02, "{training}");
        let validation = &learned["validation"];
        assert!(loss(validation, 0) <= loss(validation, 1) * 1.000_001);
        // A scale chosen with hindsight is reported only for validation crops.
        let name = |scores: &Value, i: usize| scores[i]["name"].as_str().unwrap().to_owned();
        assert_eq!(name(validation, 3), "learned table, best scale");
        assert!(
            loss(validation, 3) <= loss(validation, 2) * 1.000_001,
            "{validation}"
        );
        let asked = training.as_array().expect("scores").len();
        assert!((0..asked).all(|i| !name(training, i).contains("best scale")));
    }
}

#[test]
fn table_files_are_named_after_the_lookup() {
    let place = ready();
    let args = "--steps 2 --lookup linear --hold-out walls";
    let ended = place
        .opsr(&format!("{QUICK} {args} --run run --out tables"))
        .done();
    assert!(ended.err.contains("recording glass 24,32"), "{}", ended.err);
    let path = place.path().join("tables/fast-beta-0.001-linear.json");
    let file = TableFile::load(&path).expect("a table");
    assert_eq!(file.table.lookup, Lookup::Linear);
    let about = file.provenance.expect("provenance");
    // A held-out family is scored, but not learned from.
    assert_eq!(about.scenes.len(), 1);
    let report = json(place.read("run/report.json"));
    assert_eq!(report["names"], serde_json::json!(["glass 24,32"]));
    assert_eq!(
        report["validation_names"],
        serde_json::json!(["walls 16,16", "kept 0,32"])
    );
}

#[test]
fn errors_before_training_name_the_setting_or_file() {
    let place = scenes();
    let run = "--run run --out tables --progress none";
    let ended = place.opsr(&format!("{QUICK} {run}"));
    assert_eq!(ended.code, Some(3), "{}", ended.err);
    assert!(ended.err.contains("there is no reference"), "{}", ended.err);
    let reference = "scenes reference --manifest list.toml --spp 2";
    place.opsr(reference).done();
    for (args, word) in [
        (
            "--set scenes=['glass','other']",
            "no training scene `other`",
        ),
        ("--config scene.glb", "scene.glb"),
    ] {
        let ended = place.opsr(&format!("{QUICK} {run} {args}"));
        assert_eq!(ended.code, Some(3), "{args}: {}", ended.err);
        assert!(ended.err.contains(word), "{args}: {}", ended.err);
    }
    for (args, word) in [
        ("--set nonsense=1", "nonsense"),
        ("--set spp=many", "--set spp=many"),
        ("--set spp=1", "spp: expected 2"),
        ("--beta=-1e9", "beta: expected"),
        ("--set learning_rate=-1", "learning_rate: expected"),
        ("--set record_gammas=[0]", "record_gammas: expected"),
        ("--set start=1.5", "start: expected"),
        ("--set checkpoint_every=0", "checkpoint_every: expected"),
        ("--method quick", "quick"),
    ] {
        let ended = place.opsr(&format!("{QUICK} {run} {args}"));
        assert_eq!(ended.code, Some(2), "{args}: {}", ended.err);
        assert!(ended.err.contains(word), "{args}: {}", ended.err);
    }
    // A reference of another seed is refused.
    std::fs::remove_file(place.path().join("references/kept_0_32.exr")).expect("removed");
    (place.opsr(&format!("{reference} --scene kept --seed 9"))).done();
    let ended = place.opsr(&format!("{QUICK} {run}"));
    assert_eq!(ended.code, Some(3), "{}", ended.err);
    assert!(ended.err.contains("kept_0_32.exr: its "), "{}", ended.err);
    // A file in place of the folder.
    let ended = place.opsr(&format!("{QUICK} --run scene.glb/run --out tables"));
    assert_eq!(ended.code, Some(4), "{}", ended.err);
}
