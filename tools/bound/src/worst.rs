//! The worst path: execution counts of the graph's edges that maximise the cost.
//!
//! The method is implicit path enumeration (Li and Malik, *Performance analysis of embedded
//! software using implicit path enumeration*, DAC 1995): every block is left as often as it is
//! entered, a loop iterates no more often than declared, and a linear programme finds the most
//! expensive counts. Its relaxation to real numbers can only exceed the true maximum, so the result
//! is a bound.

use std::collections::{BTreeMap, BTreeSet};

use microlp::{
    ComparisonOp, LinearExpr, OptimizationDirection, Problem, SolutionStatus, SolveOutcome,
};

use crate::BoundError;
use crate::connected::strongly_connected;
use crate::cost;
use crate::graph::Graph;
use crate::image::Frame;
use crate::instruction::{ARGUMENTS, Instruction};
use crate::loops::{CLEARED_BYTES, CLEARS, Limit, Limits};
use crate::values::{Program, Value, Values, after};

/// Smaller counts are rounding errors of the linear programme.
const LEAST_FLOW: f64 = 1e-6;

/// The worst case of a function.
#[derive(Clone, Debug)]
pub struct Worst {
    /// Address of the first instruction.
    pub entry: u32,
    /// Cycles from the first instruction to the return, including calls.
    pub cycles: u32,
    /// The worst path in the order of execution.
    pub path: Vec<Visit>,
    /// Instructions on that path, including calls.
    pub instructions: u32,
    /// Whether it or a function that it calls uses the floating-point unit.
    pub uses_float: bool,
    /// Loops of the function.
    pub loops: Vec<Loop>,
    /// Addresses of the function's instructions that are charged with the wait for a peripheral.
    pub peripheral_accesses: Vec<u32>,
}

/// A block of the worst path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Visit {
    /// Address of the block.
    pub block: u32,
    /// Number of executions.
    pub times: f64,
    /// Cycles of all executions, including called functions and the entries to the block.
    pub cycles: f64,
    /// Function that it calls.
    pub call: Option<u32>,
}

/// A loop of the machine code.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Loop {
    /// Address of the first instruction.
    pub header: u32,
    /// Blocks of the loop.
    pub blocks: BTreeSet<u32>,
    /// First and last instruction of each block.
    pub addresses: Vec<(u32, u32)>,
    /// Limit of the loop.
    pub limit: Limit,
}

impl Loop {
    /// Returns whether an instruction is part of the loop; those of called functions are not.
    pub fn contains(&self, address: u32) -> bool {
        let mut all = self.addresses.iter();
        all.any(|(first, last)| (*first..=*last).contains(&address))
    }
}

/// Finds the worst case of functions, once each.
pub struct Analysis<'a> {
    program: &'a Program<'a>,
    limits: &'a Limits,
    known: BTreeMap<u32, Option<Worst>>,
    /// Functions whose analysis has begun.
    open: BTreeSet<u32>,
    not_called: BTreeSet<u32>,
}

impl<'a> Analysis<'a> {
    /// Creates an analysis of a program.
    pub fn new(program: &'a Program<'a>, limits: &'a Limits) -> Self {
        Self {
            program,
            limits,
            known: BTreeMap::new(),
            open: BTreeSet::new(),
            not_called: BTreeSet::new(),
        }
    }

    /// Excludes paths that call one of these functions.
    pub fn without(mut self, functions: &BTreeSet<u32>) -> Self {
        self.not_called.clone_from(functions);
        self
    }

    /// Returns the analysed functions.
    pub fn functions(&self) -> impl Iterator<Item = &Worst> {
        self.known.values().flatten()
    }

    /// Returns the worst path of an analysed function with those of the functions that it calls, in order.
    pub fn path_with_calls(&self, worst: &Worst) -> Vec<Visit> {
        let mut all = Vec::new();
        for visit in &worst.path {
            let called = visit
                .call
                .and_then(|callee| self.known.get(&callee)?.as_ref());
            let inside = called.map_or(0.0, |it| f64::from(it.cycles));
            all.push(Visit {
                cycles: visit.cycles - visit.times * inside,
                ..*visit
            });
            let path = called.map(|it| self.path_with_calls(it));
            all.extend(path.into_iter().flatten().map(|within| Visit {
                times: visit.times * within.times,
                cycles: visit.times * within.cycles,
                ..within
            }));
        }
        all
    }

    /// Returns the worst case of the program's function at `entry`; `None` if it never returns.
    ///
    /// # Errors
    /// [`BoundError`] for code that cannot be bounded.
    pub fn of(&mut self, entry: u32) -> Result<Option<Worst>, BoundError> {
        if self.not_called.contains(&entry) {
            // As if it did not return: no path leads on from the call.
            return Ok(None);
        }
        if let Some(worst) = self.known.get(&entry) {
            return Ok(worst.clone());
        }
        if !self.open.insert(entry) {
            return Err(BoundError::Recursion { address: entry });
        }
        let program = self.program;
        let function = program.function(entry);
        let (graph, values) = function.ok_or(BoundError::NotFollowed { address: entry })?;
        let worst = self.of_graph(graph, values)?;
        self.known.insert(entry, worst.clone());
        Ok(worst)
    }

    /// Returns the worst case of a part of a function; `None` if no path ends there.
    ///
    /// # Errors
    /// [`BoundError`] for code that cannot be bounded.
    pub fn of_graph(
        &mut self,
        graph: &Graph,
        values: &BTreeMap<u32, Values>,
    ) -> Result<Option<Worst>, BoundError> {
        let mut calls = BTreeMap::new();
        let mut uses_float = graph.uses_float();
        for block in graph.blocks.values() {
            if let Some(callee) = block.call {
                let worst = self.of(callee)?;
                uses_float |= worst.as_ref().is_some_and(|worst| worst.uses_float);
                calls.insert(
                    callee,
                    worst.map(|worst| (worst.cycles, worst.instructions)),
                );
            }
        }
        let worst = self.solve(graph, values, &calls)?;
        Ok(worst.map(|worst| Worst {
            uses_float,
            ..worst
        }))
    }

    fn solve(
        &self,
        graph: &Graph,
        values: &BTreeMap<u32, Values>,
        calls: &BTreeMap<u32, Option<(u32, u32)>>,
    ) -> Result<Option<Worst>, BoundError> {
        let (image, chip) = (self.program.image, self.program.image.chip);
        let loops = self.loops(graph)?;
        let mut costs: BTreeMap<u32, u32> = BTreeMap::new();
        let mut peripheral_accesses = Vec::new();
        for (address, block) in &graph.blocks {
            block.instructions.iter().try_for_each(Instruction::check)?;
            let known = values.get(address).cloned().unwrap_or_default();
            if let Some(callee) = block.call
                && image.name(callee).contains(CLEARS)
            {
                let arguments = after(block, chip, &known);
                let few = |bytes: &Value| matches!(bytes, Value::Constant(..=CLEARED_BYTES));
                if !arguments.get(&ARGUMENTS[1]).is_some_and(few) {
                    return Err(BoundError::ClearsTooMuch { address: *address });
                }
            }
            let call = block.call.and_then(|callee| calls[&callee]);
            let call = call.map_or(0, |(cycles, _)| {
                // Call and return.
                let callee = block.call.unwrap_or(*address);
                cycles + chip.branch(callee) + chip.branch(*address)
            });
            peripheral_accesses.extend(cost::peripheral_accesses(block, chip, &known));
            costs.insert(*address, cost::of_block(block, chip, &known) + call);
        }
        // A wait for hardware costs its time plus two iterations, however often it iterates.
        let mut entered: BTreeMap<u32, u32> = BTreeMap::new();
        for one in &loops {
            if let Limit::Cycles(cycles) = one.limit {
                let round: u32 = one.blocks.iter().map(|block| costs[block]).sum();
                let edges = one.blocks.len() as u32 * chip.branch(one.header);
                entered.insert(one.header, cycles + 2 * (round + edges));
                for block in &one.blocks {
                    costs.insert(*block, 0);
                }
            }
        }
        let waits: BTreeSet<u32> = loops
            .iter()
            .filter(|one| matches!(one.limit, Limit::Cycles(_)))
            .flat_map(|one| one.blocks.iter().copied())
            .collect();

        let mut problem = Problem::new(OptimizationDirection::Maximize);
        let mut incoming: BTreeMap<u32, Vec<_>> = BTreeMap::new();
        let mut outgoing: BTreeMap<u32, Vec<_>> = BTreeMap::new();
        let mut edges = Vec::new();
        let first = costs[&graph.entry] + entered.get(&graph.entry).copied().unwrap_or(0);
        let start = problem.add_var(f64::from(first), (1.0, 1.0));
        incoming.entry(graph.entry).or_default().push(start);
        let mut ends = Vec::new();
        for (from, block) in &graph.blocks {
            let never_returns =
                !block.may_skip_call && block.call.is_some_and(|callee| calls[&callee].is_none());
            if block.returns {
                let end = problem.add_var(0.0, (0.0, 1.0));
                outgoing.entry(*from).or_default().push(end);
                ends.push(end);
            }
            if never_returns {
                continue;
            }
            for (to, taken) in &block.successors {
                let inside = loops
                    .iter()
                    .any(|one| one.header == *to && one.blocks.contains(from));
                let mut cycles = costs[to];
                if !(waits.contains(from) && waits.contains(to)) {
                    // The cost of the call includes the way into the function and back.
                    let taken = *taken && block.call.is_none();
                    cycles += cost::of_edge(chip, block, &graph.blocks[to], taken);
                }
                if !inside {
                    cycles += entered.get(to).copied().unwrap_or(0);
                }
                let edge = problem.add_var(f64::from(cycles), (0.0, f64::INFINITY));
                outgoing.entry(*from).or_default().push(edge);
                incoming.entry(*to).or_default().push(edge);
                edges.push((*from, *to, edge, cycles));
            }
        }
        if ends.is_empty() {
            return Ok(None);
        }
        for address in graph.blocks.keys() {
            let mut balance = LinearExpr::empty();
            let into: Vec<_> = incoming.get(address).into_iter().flatten().collect();
            let out: Vec<_> = outgoing.get(address).into_iter().flatten().collect();
            // A block that follows itself is entered and left by the same edge.
            for edge in into.iter().filter(|edge| !out.contains(edge)) {
                balance.add(**edge, 1.0);
            }
            for edge in out.iter().filter(|edge| !into.contains(edge)) {
                balance.add(**edge, -1.0);
            }
            problem.add_constraint(balance, ComparisonOp::Eq, 0.0);
        }
        for one in &loops {
            // Iterations after the first, for each entry.
            let again = match one.limit {
                Limit::Times(times) => f64::from(times.saturating_sub(1)),
                Limit::Cycles(_) => 1.0,
            };
            let mut rounds = LinearExpr::empty();
            for (from, to, edge, _) in &edges {
                if *to == one.header {
                    let back = one.blocks.contains(from);
                    rounds.add(*edge, if back { 1.0 } else { -again });
                }
            }
            if graph.entry == one.header {
                rounds.add(start, -again);
            }
            problem.add_constraint(rounds, ComparisonOp::Le, 0.0);
        }
        let outcome = problem.solve()?;
        let SolveOutcome::Solution(solution) = outcome else {
            return Err(BoundError::NoOptimum);
        };
        if solution.status() != SolutionStatus::Optimal {
            return Err(BoundError::NoOptimum);
        }

        let mut worst = Worst {
            entry: graph.entry,
            cycles: solution.objective().ceil() as u32,
            path: Vec::new(),
            instructions: 0,
            uses_float: false,
            loops,
            peripheral_accesses,
        };
        let mut visits: BTreeMap<u32, Visit> = BTreeMap::new();
        let flows = [(graph.entry, graph.entry, start, f64::from(first))]
            .into_iter()
            .chain(
                edges
                    .iter()
                    .map(|(from, to, edge, cycles)| (*from, *to, *edge, f64::from(*cycles))),
            );
        let mut next: BTreeMap<u32, Vec<u32>> = BTreeMap::new();
        for (from, to, edge, cycles) in flows {
            let times = solution[edge];
            if times < LEAST_FLOW {
                continue;
            }
            if edge != start {
                next.entry(from).or_default().push(to);
            }
            let visit = visits.entry(to).or_insert(Visit {
                block: to,
                times: 0.0,
                cycles: 0.0,
                call: graph.blocks[&to].call,
            });
            visit.times += times;
            visit.cycles += times * cycles;
        }
        let mut instructions = 0.0_f64;
        for (address, visit) in &visits {
            let block = &graph.blocks[address];
            let call = block.call.and_then(|callee| calls[&callee]);
            let inside = call.map_or(0, |(_, instructions)| instructions);
            instructions += visit.times * (block.instructions.len() as f64 + f64::from(inside));
        }
        worst.path = in_order(graph.entry, &next, &visits);
        worst.instructions = instructions.ceil() as u32;
        Ok(Some(worst))
    }

    /// Returns the loops of a function with their limits, one for each header of a strongly
    /// connected component.
    fn loops(&self, graph: &Graph) -> Result<Vec<Loop>, BoundError> {
        let image = self.program.image;
        let mut loops = Vec::new();
        let mut parts = vec![graph.blocks.keys().copied().collect::<BTreeSet<u32>>()];
        while let Some(part) = parts.pop() {
            for connected in strongly_connected(graph, &part) {
                let inside = |address: &u32| connected.contains(address);
                let headers: Vec<u32> = connected
                    .iter()
                    .copied()
                    .filter(|to| {
                        *to == graph.entry
                            || graph.blocks.iter().any(|(from, block)| {
                                !inside(from) && block.successors.iter().any(|(at, _)| at == to)
                            })
                    })
                    .collect();
                let [header] = headers[..] else {
                    return Err(BoundError::Irreducible {
                        address: connected.first().copied().unwrap_or_default(),
                    });
                };
                let limit = self
                    .limits
                    .of(image, graph, header, &connected)
                    .ok_or_else(|| {
                        let frames = image.frames(header);
                        let ours = |frame: &&Frame| frame.function.contains("painleve");
                        let innermost = frames.first().filter(|frame| !ours(frame));
                        let places: Vec<String> = innermost
                            .into_iter()
                            .chain(frames.iter().filter(ours).take(2))
                            .map(|frame| {
                                format!("{} ({}:{})", frame.function, frame.file, frame.line)
                            })
                            .collect();
                        BoundError::Unbounded {
                            address: header,
                            place: places.join(" in "),
                        }
                    })?;
                let mut inner = connected.clone();
                inner.remove(&header);
                parts.push(inner);
                loops.push(Loop {
                    header,
                    addresses: connected
                        .iter()
                        .filter_map(|block| {
                            let last = graph.blocks[block].instructions.last()?;
                            Some((*block, last.address))
                        })
                        .collect(),
                    blocks: connected,
                    limit,
                });
            }
        }
        Ok(loops)
    }
}

/// Returns the blocks in the order in which a path first reaches them.
fn in_order(
    entry: u32,
    next: &BTreeMap<u32, Vec<u32>>,
    visits: &BTreeMap<u32, Visit>,
) -> Vec<Visit> {
    // The reverse of the order in which a depth-first search finishes them.
    let (mut seen, mut left) = (BTreeSet::new(), Vec::new());
    let mut stack = vec![(entry, false)];
    while let Some((at, done)) = stack.pop() {
        if done {
            left.extend(visits.get(&at).copied());
        } else if seen.insert(at) {
            stack.push((at, true));
            let after = next.get(&at).into_iter().flatten();
            stack.extend(after.map(|to| (*to, false)));
        }
    }
    left.reverse();
    left
}

#[cfg(test)]
mod tests;
