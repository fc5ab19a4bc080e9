use super::*;
use crate::derivative::accumulate_with_gradient;
use rand::{RngExt, SeedableRng};

#[test]
fn alphas_and_gradients_of_lists_match_those_of_single_paths() {
    let mut rng = rand_pcg::Pcg32::seed_from_u64(3);
    let values = [0.0, 0.02, 0.1, 0.3, 0.7, 1.0];
    let mut tree = Interner::default();
    let mut lists = Vec::new();
    // More than a chunk, so that a chunk begins in the middle of lists with a common prefix.
    for _ in 0..4 * CHUNK {
        let n = rng.random_range(1..12);
        let list: Vec<f32> = (0..n).map(|_| values[rng.random_range(0..6)]).collect();
        let intern = |at: Option<u32>, alpha: &f32| Some(tree.intern(at, *alpha));
        if let Some(code) = list.iter().fold(None, intern) {
            lists.push((list, code));
        }
    }
    lists.retain(|(_, code)| code % 7 != 0);
    let mut used = vec![false; tree.len()];
    for (list, code) in &lists {
        assert_eq!(&tree.list(*code), list);
        used[*code as usize] = true;
    }
    let (sorted, place) = tree.sorted(&used);
    assert_eq!(sorted.len(), used.iter().filter(|u| **u).count());
    // Another tree that has some of the lists already.
    let mut other = Interner::default();
    let first = other.intern(None, 0.3);
    other.intern(Some(first), 0.7);
    let moved = other.absorb(&tree, used.clone());
    for (list, code) in &lists {
        assert_eq!(&other.list(moved[*code as usize]), list);
    }
    assert!(other.len() < tree.len());
    assert!(sorted.len() > 2 * CHUNK && sorted.shared.iter().any(|&s| s > 3));
    let mut table = AttenuationTable::constant(0.0);
    table.gammas.fill_with(|| rng.random());
    let (alphas, gradients) = (sorted.alphas(&table), sorted.alphas_with_gradient(&table));
    for (list, old) in &lists {
        let code = place[*old as usize];
        assert_eq!(sorted.list(code), list);
        let (alpha, gradient) = accumulate_with_gradient(list, &table);
        assert_eq!(alphas[code as usize], alpha);
        assert_eq!(gradients.at(code), (alpha, &gradient[..]));
    }
    // In any order, and after others.
    let mut buffer = PrefetchBuffer::default();
    for step in [3, 7] {
        let some = (0..sorted.len() as u32).rev().step_by(step);
        gradients.prefetch(some.clone(), &mut buffer);
        let found = gradients.prefetched(&buffer);
        assert!(found.eq(some.map(|code| gradients.at(code))));
    }
    let (long, all) = sorted.long();
    for (code, &of_all) in (0u32..).zip(&all) {
        assert_eq!(long.list(code), sorted.list(of_all));
    }
    let folds = (0..sorted.len() as u32).filter(|&code| sorted.is_long(code));
    assert!(folds.eq(all));
}
