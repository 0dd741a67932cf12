//! Strongly connected components of a graph: its loops.

use std::collections::{BTreeMap, BTreeSet};

use crate::graph::Graph;

/// Returns the strongly connected components within `part` that have more than one block, or one
/// that follows itself.
pub fn strongly_connected(graph: &Graph, part: &BTreeSet<u32>) -> Vec<BTreeSet<u32>> {
    let successors = |from: u32| {
        let block = graph.blocks.get(&from);
        let all = block.into_iter().flat_map(|block| &block.successors);
        all.map(|(to, _)| *to).filter(|to| part.contains(to))
    };
    // Kosaraju's algorithm: the finishing order of one search, then searches along reversed edges.
    let (mut seen, mut order) = (BTreeSet::new(), Vec::new());
    for root in part {
        let mut stack = vec![(*root, false)];
        while let Some((at, done)) = stack.pop() {
            if done {
                order.push(at);
            } else if seen.insert(at) {
                stack.push((at, true));
                stack.extend(successors(at).map(|to| (to, false)));
            }
        }
    }
    let mut before: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
    for from in part {
        for to in successors(*from) {
            before.entry(to).or_default().push(*from);
        }
    }
    let (mut taken, mut found) = (BTreeSet::new(), Vec::new());
    for root in order.into_iter().rev() {
        let mut connected = BTreeSet::new();
        let mut stack = vec![root];
        while let Some(at) = stack.pop() {
            if taken.insert(at) {
                connected.insert(at);
                stack.extend(before.get(&at).into_iter().flatten());
            }
        }
        let again = connected.len() > 1
            || connected
                .iter()
                .any(|at| successors(*at).any(|to| to == *at));
        if again && !connected.is_empty() {
            found.push(connected);
        }
    }
    found
}
