//! `opsr verify`: every subject at test size; planted faults are detected, with their exit codes.

use super::{RunResult, TestFolder};
use opsr_lab::verify::{NUMERIC, Size, images, simple::Fault, soak};

fn verify(arguments: &str) -> RunResult {
    TestFolder::new().opsr(&format!("verify --tiny {arguments}"))
}

#[test]
fn verify_prints_a_table_of_every_case() {
    for arguments in ["", "numeric"] {
        let ended = verify(arguments).done();
        let lines: Vec<&str> = ended.out.lines().collect();
        assert!(lines[0].starts_with("case") && lines[0].ends_with("bound"));
        assert_eq!(lines.last(), Some(&"all hold"));
        for case in &NUMERIC {
            assert!(lines.iter().any(|l| l.starts_with(case.name)));
        }
    }
}

#[test]
fn verify_writes_json_with_statistics_and_thresholds() {
    let subjects = ["render", "determinism", "resume", "soak"];
    let training = cfg!(feature = "train").then_some("train");
    for subject in subjects.into_iter().chain(training) {
        let ended = verify(&format!("{subject} --json")).done();
        let findings: serde_json::Value = serde_json::from_str(&ended.out).unwrap();
        let findings = findings.as_array().unwrap();
        assert!(findings.len() >= 2, "{subject}: {findings:?}");
        for finding in findings {
            assert_eq!(finding["case"], subject);
            assert_eq!(finding["holds"], true, "{finding}");
            assert!(finding["worst"].as_f64() <= finding["bound"].as_f64());
        }
    }
}

#[test]
fn verify_render_finds_a_planted_fault() {
    let ended = verify("render --plant missing-eta2").done();
    let last: Vec<&str> = ended.out.lines().rev().take(2).collect();
    assert_eq!(
        last,
        [
            "every planted fault is found",
            "planted missing-eta2: found"
        ]
    );
    // So few samples cannot detect a picture 1 % too bright.
    let ended = verify("render --plant brightness");
    assert_eq!(ended.code, Some(1), "{}", ended.out);
    let missed = "planted brightness: NOT FOUND";
    assert!(ended.out.contains(missed), "{}", ended.out);
    assert_eq!(verify("render --plant nothing").code, Some(2));
}

#[test]
fn verify_render_finds_every_planted_fault_but_the_smallest() {
    for (name, fault) in Fault::ALL {
        let findings = images::all(Size::Tiny, Some(fault));
        let found = findings.iter().any(|f| !f.holds());
        assert_eq!(found, fault != Fault::Brightness, "{name}: {findings:?}");
    }
}

#[test]
fn soak_sees_memory_that_grows() {
    let steady = [9.0, 10.0, 10.0, 11.0, 10.0, 12.0, 10.0, 11.0, 10.0];
    assert_eq!(soak::growth(&steady), 0.0);
    let leak: Vec<f64> = (0..9).map(|i| 100.0 + f64::from(i)).collect();
    assert!(soak::growth(&leak) > 2.0);
}
