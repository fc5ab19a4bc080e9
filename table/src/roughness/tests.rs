use super::*;

#[test]
fn bin_edges_are_the_rounded_solutions_of_the_formula() {
    for (k, &edge) in BIN_EDGES.iter().enumerate() {
        let exact = (1.0 + (k as f64 + 1.0) / 5.0).log2().powi(2);
        assert_eq!(edge, exact as f32, "edge {k}: {exact}");
        assert_eq!([bin(edge.next_down()), bin(edge)], [k, k + 1]);
    }
}

#[test]
fn gamma_index_is_a_bijection_onto_1360_classes() {
    let mut seen = vec![false; crate::LEN];
    for n in 2..=5usize {
        for code in 0..4usize.pow(n as u32) {
            let bins: Vec<_> = (0..n)
                .rev()
                .map(|i| code / 4usize.pow(i as u32) % 4)
                .collect();
            let class = GammaIndex::from_bins(&bins).unwrap();
            assert_eq!(class.bins(), bins);
            assert_eq!(class.suffix(), GammaIndex::from_bins(&bins[1..]));
            assert_eq!(class.suffix().is_some(), n > 2);
            assert!(!std::mem::replace(&mut seen[class.index()], true));
        }
    }
    assert!(seen.iter().all(|&s| s));
}

#[test]
fn class_of_a_path_has_the_bins_of_its_vertices() {
    let factor = crate::ConstantGamma(0.5);
    let path = [0.8, 0.0, 0.3, 0.1, 0.5];
    for n in 1..=5 {
        let (last, before) = path[..n].split_last().unwrap();
        let bins: Vec<_> = path[..n].iter().map(|&a| bin(a)).collect();
        let prefix = PathRoughness::of(before, &factor);
        assert_eq!(prefix.class(*last), GammaIndex::from_bins(&bins));
    }
}

/// A folded value contains the surplus times `shrink`.
#[test]
fn folding_applies_shrink() {
    let factor = crate::ConstantGamma(0.5);
    for shrink in [1.0, 0.25, 0.0] {
        let mut path = PathRoughness::default();
        for alpha in [0.2, 0.4, 0.0, 1.0] {
            path.push(alpha, &factor, shrink);
        }
        // 1 − 0.9 · 0.8 · 1 · 0.5 = 0.64.
        let folded = 0.1 + 0.9 * 0.64 * shrink;
        assert!((path.accumulate(0.1, &factor, shrink) - folded).abs() < 1e-6);
        path.push(0.1, &factor, shrink);
        assert_eq!(path.values().len(), 1);
        assert!((path.values()[0] - folded).abs() < 1e-6, "{shrink}");
        assert_eq!(path.class(0.0), GammaIndex::from_bins(&[bin(folded), 0]));
    }
}
