use super::*;

fn scattered(alpha: f32, pdf_w: f32) -> Scattered {
    Scattered { alpha, pdf_w }
}

#[test]
fn pbrt_doubles_sharp_lobes_after_a_rough_bounce() {
    let rule = Rule::Pbrt;
    let mut path = rule.start(0);
    rule.scatter(&mut path, scattered(0.0, f32::INFINITY));
    assert_eq!(rule.roughen(&path, 0.01), 0.01);
    rule.scatter(&mut path, scattered(1e-3, 9.0));
    // A later Dirac bounce does not undo it.
    rule.scatter(&mut path, scattered(0.0, f32::INFINITY));
    for (own, blurred) in [
        (0.0, 0.1),
        (0.01, 0.1),
        (0.1, 0.2),
        (0.2, 0.3),
        (0.295, 0.3),
        (0.3, 0.3),
        (0.305, 0.305),
        (0.7, 0.7),
    ] {
        assert_eq!(rule.roughen(&path, own), blurred);
    }
}

#[test]
fn filter_glossy_follows_the_least_density() {
    let rule = Rule::FilterGlossy(4.0);
    let mut path = rule.start(0);
    assert_eq!(rule.roughen(&path, 0.01), 0.01);
    for (pdf_w, expected) in [(8.0, 0.01), (4.0, 0.01), (3.0, 0.25), (5.0, 0.25)] {
        rule.scatter(&mut path, scattered(0.0, pdf_w));
        assert_eq!(rule.roughen(&path, 0.01), expected, "{pdf_w}");
    }
    assert_eq!(rule.roughen(&path, 0.6), 0.6);
}

#[test]
fn roughness_clamp_remembers_the_roughest_vertex() {
    let rule = Rule::RoughnessClamp;
    let mut path = rule.start(0);
    assert_eq!(rule.roughen(&path, 0.01), 0.01);
    for (own, largest) in [(0.2, 0.2), (0.1, 0.2), (0.5, 0.5)] {
        rule.scatter(&mut path, scattered(own, 1.0));
        assert_eq!(rule.roughen(&path, 0.01), largest);
        assert_eq!(rule.roughen(&path, 0.9), 0.9);
    }
}

#[test]
fn mollifier_leaves_roughness_alone_and_shrinks_its_kernel() {
    let rule = Rule::Mollifier(0.1);
    let mut path = rule.start(0);
    assert_eq!(rule.mollifier_radius(&path), Some(0.1));
    rule.scatter(&mut path, scattered(1.0, 1.0));
    assert_eq!(rule.mollifier_radius(&path), Some(0.1));
    assert_eq!(rule.roughen(&path, 0.3), 0.3);
    // Sample 64 has half the radius: 64^(−1/6).
    let later = rule.mollifier_radius(&rule.start(63)).unwrap();
    assert!((later - 0.05).abs() < 1e-8);
    assert_eq!(Rule::Pbrt.mollifier_radius(&path), None);
}

#[test]
fn rules_have_the_same_fingerprint_only_if_they_are_equal() {
    let table = |gamma, lookup, scale| {
        Rule::with_table(AttenuationTable {
            lookup,
            scale,
            ..AttenuationTable::constant(gamma)
        })
    };
    let consistent = Rule::Accumulated(Accumulated {
        factors: Factors::Table(AttenuationTable::constant(0.5)),
        lambda: 0.2,
    });
    let rules = [
        Rule::Plain,
        Rule::constant(0.5),
        Rule::constant(0.25),
        table(0.5, Lookup::Nearest, 1.0),
        table(0.25, Lookup::Nearest, 1.0),
        table(0.5, Lookup::Linear, 1.0),
        table(0.5, Lookup::Nearest, 2.0),
        consistent,
        Rule::Pbrt,
        Rule::FilterGlossy(1.0),
        Rule::FilterGlossy(2.0),
        Rule::RoughnessClamp,
        Rule::Mollifier(0.01),
    ];
    for (i, a) in rules.iter().enumerate() {
        for (j, b) in rules.iter().enumerate() {
            assert_eq!(a.fingerprint() == b.fingerprint(), i == j, "{a:?} {b:?}");
        }
    }
}
