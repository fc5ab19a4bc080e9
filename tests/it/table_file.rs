//! Table files: saved tables are read back bit-identical; other files are refused with their name.

use crate::fuzz::seeds;
use opsr::regularise::file::{TableFile, VERSION, save};
use opsr::regularise::{AttenuationTable, LEN};
use serde_json::{Value, json};
use std::path::Path;

fn parse(bytes: &[u8]) -> Result<TableFile, String> {
    TableFile::parse(bytes, Path::new("params/a.json")).map_err(|e| e.to_string())
}

fn bits(table: &AttenuationTable) -> Vec<u32> {
    table.gammas.iter().map(|g| g.to_bits()).collect()
}

#[test]
fn round_trip_of_a_table_file_is_bit_identical() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.json");
    let mut file = seeds::table();
    // Random significands: few of them have a short decimal form.
    for (i, gamma) in file
        .table
        .gammas
        .iter_mut()
        .enumerate()
        .take(LEN - 1)
        .skip(2)
    {
        *gamma = f32::from_bits(gamma.to_bits() ^ (i as u32).wrapping_mul(2_654_435_761) >> 12);
        assert!((0.0..=1.0).contains(gamma));
    }
    file.table.scale = 1.0 / 3.0;
    save(&file, &path).unwrap();
    let again = TableFile::load(&path).unwrap();
    assert_eq!(bits(&again.table), bits(&file.table));
    assert_eq!(again, file);
    assert_eq!(again.digest(), file.digest());
    // Saving again gives the same text, and no other file remains in the folder.
    let text = std::fs::read(&path).unwrap();
    save(&again, &path).unwrap();
    assert!(std::fs::read(&path).unwrap() == text);
    assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
}

#[test]
fn digest_covers_factors_scale_and_lookup_only() {
    let mut table = AttenuationTable::constant(0.25);
    let file = TableFile {
        table: table.clone(),
        provenance: None,
    };
    let text = file.to_json().unwrap();
    assert_eq!(parse(text.as_bytes()).unwrap(), file);
    // Everything that a render depends on changes the digest.
    let digest = |table: &AttenuationTable, provenance| {
        let table = table.clone();
        TableFile { table, provenance }.digest()
    };
    let first = digest(&table, None);
    assert_eq!(first, digest(&table, Some(seeds::provenance())));
    table.gammas[LEN - 1] = f32::from_bits(0.25f32.to_bits() + 1);
    let second = digest(&table, None);
    table.scale = 2.0;
    let third = digest(&table, None);
    table.lookup = opsr::regularise::Lookup::Linear;
    let all = [first, second, third, digest(&table, None)];
    assert!((0..4).all(|i| !all[..i].contains(&all[i])));
}

#[test]
fn table_file_is_readable_text() {
    let text = seeds::table().to_json().unwrap();
    assert!(
        text.lines().all(|line| line.len() < 260),
        "rows, not one line"
    );
    assert!(text.lines().count() < 260);
    let head = &text[..400];
    for word in [
        "opsr attenuation table",
        "version",
        "levels",
        "order",
        "linear",
    ] {
        assert!(head.contains(word), "{word}");
    }
}

#[test]
fn malformed_tables_are_refused_by_name() {
    let good: Value = serde_json::from_str(&seeds::table().to_json().unwrap()).unwrap();
    let with = |pointer: &str, value: Value| {
        let mut json = good.clone();
        *json.pointer_mut(pointer).expect(pointer) = value;
        json.to_string()
    };
    let without = |key: &str| {
        let mut json = good.clone();
        json.as_object_mut().unwrap().remove(key).expect(key);
        json.to_string()
    };
    let mut extra = good.clone();
    extra["colour"] = json!("red");
    let order = "2, 3, 4, 5 vertices; levels as base-4 digits, the vertex nearest the light first";
    let later = json!({ "format": "opsr attenuation table", "version": 2, "else": [] });
    let cases = [
        (
            with("/format", json!("opsr table")),
            "format: `opsr table` is not",
        ),
        (
            with("/version", json!(VERSION + 1)),
            "version: 2 where this program reads 1",
        ),
        (with("/version", json!(0)), "version: 0 where"),
        (with("/version", json!("1")), "invalid type"),
        // The version is reported even if the other fields differ.
        (later.to_string(), "version: 2 where"),
        (with("/levels", json!(5)), "levels: 5, expected 4"),
        (with("/order", json!(order)), "order: `2, 3, 4, 5 vertices"),
        (
            with("/gammas", json!([0.5])),
            "gammas: 1 numbers, expected 1360",
        ),
        (
            with("/gammas", json!(vec![0.5; LEN + 1])),
            "gammas: 1361 numbers",
        ),
        (
            with("/gammas/7", json!(1.0000002)),
            "gammas[7]: 1.0000002 is outside [0, 1]",
        ),
        (
            with("/gammas/1359", json!(-0.1)),
            "gammas[1359]: -0.1 is outside",
        ),
        (with("/gammas/0", json!(1e300)), "number out of range"),
        (with("/gammas/0", json!(null)), "invalid type: null"),
        (with("/scale", json!(0)), "scale: 0 is not a positive"),
        (with("/scale", json!(-1)), "scale: -1 is not a positive"),
        (with("/lookup", json!("cubic")), "unknown variant `cubic`"),
        (
            with("/training/visits", json!([1])),
            "training.visits: 1 numbers, expected 1360",
        ),
        (
            with("/training/visits/3", json!(-1)),
            "invalid value: integer `-1`",
        ),
        (with("/training", json!([])), "invalid"),
        (without("gammas"), "missing field `gammas`"),
        (without("format"), "missing field `format`"),
        (without("order"), "missing field `order`"),
        (extra.to_string(), "unknown field `colour`"),
        (String::new(), "EOF"),
        ("null".into(), "invalid type: null"),
        (good.to_string() + "1", "trailing characters"),
    ];
    for (text, fragment) in cases {
        let message = parse(text.as_bytes()).expect_err(fragment);
        assert!(message.starts_with("params/a.json: "), "{message}");
        assert!(message.contains(fragment), "`{message}` lacks `{fragment}`");
    }
    assert!(
        parse(b"\xff\xfe")
            .unwrap_err()
            .starts_with("params/a.json: ")
    );
}

#[test]
fn io_errors_of_table_files_name_the_file() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("table.json");
    let message = TableFile::load(&path).unwrap_err().to_string();
    assert!(message.contains("table.json"), "{message}");
    let names = "tables by name are beta-0.001, beta-0.05";
    assert!(message.contains(names), "{message}");
    let long = vec![b' '; (1 << 22) + 1];
    std::fs::write(&path, long).unwrap();
    let message = TableFile::load(&path).unwrap_err().to_string();
    assert!(
        message.contains("table.json: more than 4194304 bytes"),
        "{message}"
    );
    let nowhere = folder.path().join("none/table.json");
    let message = save(&seeds::table(), &nowhere).unwrap_err().to_string();
    assert!(message.contains("table.json"), "{message}");
}
