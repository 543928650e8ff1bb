//! Which values are worth keeping for points that stay while time goes on.
//!
//! Outputs that are evaluated at the same points at many times need some values that depend on the position alone. Each
//! such value is either computed once a point and kept, which costs memory traffic at each evaluation, or computed anew
//! each time from others. The cheapest choice is a minimum cut through the operations between the coordinates and what
//! depends on time, found by augmenting paths (L. R. Ford and D. R. Fulkerson, Canad. J. Math. 8, 1956).

use crate::program::{Operation, OperationCount, OperationsByStage, Program, Slot};
use std::collections::{BTreeMap, VecDeque};

/// Cost of reading one kept number, in additions. A number of eight bytes takes about 0.8 ns from memory at the 10 GB/s that one core gets
/// while it also computes, and an addition in a vector register of eight about 0.15 ns.
pub(crate) const KEPT_NUMBER: usize = 5;

/// Most numbers that are kept of each point for its state: 128 bytes in double precision, four times what a step needs of a particle's
/// position in the plane. Where the cheapest choice is more, some of it is computed anew.
pub const MOST_KEPT_OF_STATES: usize = 16;

/// A call costs forty additions, so that no program of a field comes to as much.
const LARGEST_PRICE: usize = 1 << 20;

/// No sum of costs reaches it.
const FORBIDDEN: usize = usize::MAX / 4;

impl Program {
    /// The values that depend on the position alone and should be kept for each point, for `outputs` that are evaluated
    /// at the same points at many times. All other operations that `outputs` need follow from these, from
    /// time and from parameters.
    ///
    /// They are at most `most`, or the coordinates where those are more: where the cheapest choice keeps more, memory
    /// counts as twice as dear, again and again.
    #[must_use]
    pub fn kept_at_points(&self, outputs: &[Slot], most: usize) -> Vec<Slot> {
        let mut price = KEPT_NUMBER;
        loop {
            let kept = self.kept_at_price(outputs, price);
            // Beyond this price all that can be computed anew is.
            if kept.len() <= most || price > LARGEST_PRICE {
                return kept;
            }
            price *= 2;
        }
    }

    /// The cheapest choice where reading one kept number costs `price`.
    fn kept_at_price(&self, outputs: &[Slot], price: usize) -> Vec<Slot> {
        let needed = self.needed(outputs);
        let of_point = |slot: &Slot| {
            let dependence = self.dependence(*slot);
            dependence.position && !dependence.time
        };
        let here: Vec<Slot> =
            self.slots().filter(|slot| needed[slot.index()] && of_point(slot)).collect();
        let vertex: BTreeMap<Slot, usize> =
            here.iter().enumerate().map(|(n, &slot)| (slot, n)).collect();
        // Two vertices a value: itself, and the memory that it takes where it is kept.
        let (memory, source, sink) = (here.len(), 2 * here.len(), 2 * here.len() + 1);
        let mut network = Network::new(2 * here.len() + 2);
        for (n, &slot) in here.iter().enumerate() {
            let operation = &self.operations()[slot.index()];
            let anew = match operation {
                // Coordinates come from nowhere else.
                Operation::Input(_) => FORBIDDEN,
                _ => OperationCount::of(operation).cost(),
            };
            network.edge(source, n, anew);
            network.edge(n, memory + n, price);
            for operand in operation.operands() {
                if let Some(&operand) = vertex.get(&operand) {
                    network.edge(memory + operand, n, FORBIDDEN);
                    // What is computed once a point has its operands there.
                    network.edge(n, operand, FORBIDDEN);
                }
            }
        }
        let read_later = self
            .slots()
            .filter(|slot| needed[slot.index()] && !vertex.contains_key(slot))
            .flat_map(|slot| self.operations()[slot.index()].operands())
            .chain(outputs.iter().copied());
        let mut read: Vec<usize> =
            read_later.filter_map(|slot| vertex.get(&slot).copied()).collect();
        read.sort_unstable();
        read.dedup();
        for n in read {
            network.edge(memory + n, sink, FORBIDDEN);
        }
        // Where two choices cost the same, the one that computes less each time.
        let later = network.reaches_after_greatest_flow(source, sink);
        (0..here.len()).filter(|&n| !later[n] && later[memory + n]).map(|n| here[n]).collect()
    }

    /// The operations that `outputs` need, by stage, where the values of `kept` are kept for each point.
    #[must_use]
    pub fn operations_with_kept(&self, outputs: &[Slot], kept: &[Slot]) -> OperationsByStage {
        let mut stages = self.operations_by_stage(outputs);
        let once_a_point = self.operations_by_stage(kept).point;
        let each_time = self.operations_after(outputs, kept);
        stages.point = once_a_point;
        stages.both = each_time;
        stages
    }

    /// The operations that depend on the position and follow from `kept`.
    fn operations_after(&self, outputs: &[Slot], kept: &[Slot]) -> OperationCount {
        let mut seen = vec![false; self.operations().len()];
        let mut stack = outputs.to_vec();
        let mut count = OperationCount::default();
        while let Some(slot) = stack.pop() {
            let skip = kept.contains(&slot) || !self.dependence(slot).position;
            if !skip && !std::mem::replace(&mut seen[slot.index()], true) {
                let operation = &self.operations()[slot.index()];
                count.count(operation);
                stack.extend(operation.operands());
            }
        }
        count
    }
}

/// A directed graph whose edges carry a flow up to their capacities.
struct Network {
    /// The edges that leave each vertex, by number. The reverse of edge `e` is edge `e ^ 1`.
    leaving: Vec<Vec<usize>>,
    /// Where each edge ends, and what it can still carry.
    edges: Vec<(usize, usize)>,
}

impl Network {
    fn new(vertices: usize) -> Self {
        Self { leaving: vec![Vec::new(); vertices], edges: Vec::new() }
    }

    fn edge(&mut self, from: usize, to: usize, capacity: usize) {
        self.leaving[from].push(self.edges.len());
        self.edges.push((to, capacity));
        self.leaving[to].push(self.edges.len());
        self.edges.push((from, 0));
    }

    /// Sends as much as possible from `source` to `sink`; then for each vertex whether it could still send to `sink`.
    fn reaches_after_greatest_flow(mut self, source: usize, sink: usize) -> Vec<bool> {
        while let Some(path) = self.shortest_path(source, sink) {
            let least = path.iter().map(|&edge| self.edges[edge].1).min().unwrap_or(0);
            for edge in path {
                self.edges[edge].1 -= least;
                self.edges[edge ^ 1].1 += least;
            }
        }
        let mut reaches = vec![false; self.leaving.len()];
        reaches[sink] = true;
        let mut queue = VecDeque::from([sink]);
        while let Some(vertex) = queue.pop_front() {
            for &edge in &self.leaving[vertex] {
                // The reverse of an edge that leaves is one that arrives.
                let from = self.edges[edge].0;
                if self.edges[edge ^ 1].1 > 0 && !reaches[from] {
                    reaches[from] = true;
                    queue.push_back(from);
                }
            }
        }
        reaches
    }

    /// The edges of a path of fewest edges that can carry more.
    fn shortest_path(&self, source: usize, sink: usize) -> Option<Vec<usize>> {
        let mut by: Vec<Option<usize>> = vec![None; self.leaving.len()];
        let mut queue = VecDeque::from([source]);
        while let Some(vertex) = queue.pop_front() {
            for &edge in &self.leaving[vertex] {
                let (to, capacity) = self.edges[edge];
                if capacity > 0 && to != source && by[to].is_none() {
                    by[to] = Some(edge);
                    queue.push_back(to);
                }
            }
        }
        let mut path = Vec::new();
        let mut vertex = sink;
        while vertex != source {
            let edge = by[vertex]?;
            path.push(edge);
            vertex = self.edges[edge ^ 1].0;
        }
        Some(path)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Ast, Dependence, Graph};
    use proptest::prelude::*;

    fn program(texts: &[&str]) -> Program {
        let mut graph = Graph::new();
        let (x, y, t) = (graph.symbol("x"), graph.symbol("y"), graph.symbol("t"));
        let position = Dependence { position: true, time: false };
        let inputs =
            [(x, position), (y, position), (t, Dependence { position: false, time: true })];
        let mut name = |_: &mut Graph, name: &str| match name {
            "x" => Ok(x),
            "y" => Ok(y),
            "t" => Ok(t),
            _ => Err("no such name".into()),
        };
        let mut build = |text: &&str| graph.build(&Ast::parse(text).unwrap(), &mut name).unwrap();
        let outputs: Vec<_> = texts.iter().map(&mut build).collect();
        Program::lower(&mut graph, &inputs, &[], &outputs)
    }

    /// Cost of the choice at each evaluation.
    fn cost(program: &Program, kept: &[Slot]) -> usize {
        let count = program.operations_with_kept(program.outputs(), kept).both;
        KEPT_NUMBER * kept.len() + count.cost()
    }

    #[test]
    fn a_few_products_are_cheaper_than_numbers_from_memory() {
        let p = program(&["t*sin(x) + t^2*sin(x)*cos(x) + sin(x)*cos(x)^2*cos(t)"]);
        let kept = p.kept_at_points(p.outputs(), usize::MAX);
        assert_eq!(kept.len(), 2, "{kept:?}");
        assert!(
            kept.iter().all(|slot| matches!(p.operations()[slot.index()], Operation::Call(..)))
        );
    }

    #[test]
    fn long_computations_are_kept() {
        let p = program(&["t*(x^2 + 3*x*y + y^2 + 7)^2 + t^2"]);
        assert_eq!(p.kept_at_points(p.outputs(), usize::MAX).len(), 1);
    }

    #[test]
    fn no_more_are_kept_than_there_is_room_for() {
        let texts =
            ["t*sin(x) + t^2*cos(x) + t^3*exp(x) + t^4*sin(y) + t^5*cos(2*x) + t^6*exp(x*y)"];
        let p = program(&texts);
        assert_eq!(p.kept_at_points(p.outputs(), 6).len(), 6);
        for most in 2..6 {
            let kept = p.kept_at_points(p.outputs(), most);
            assert!(kept.len() <= most && !reads_coordinates(&p, &kept), "{most}: {kept:?}");
        }
        // Nothing else gives the coordinates.
        let kept = p.kept_at_points(p.outputs(), 0);
        assert_eq!(kept.len(), 2);
    }

    /// Products of two, three and so on up to eight sums cost 3, 5, ..., 15 additions; the coordinate is kept for those that are
    /// computed anew. At the price of 5 six products are kept, at that of 10 three, at that of 20 none.
    #[test]
    fn each_price_is_twice_the_one_before() {
        let product =
            |n: usize| (0..n).map(|m| format!("(x + {})", 10 * n + m)).collect::<Vec<_>>();
        let texts: Vec<String> =
            (2..9).map(|n| format!("cos(t + {})", product(n).join("*"))).collect();
        let p = program(&[&texts.join(" + ")]);
        for (most, number) in [(8, 7), (7, 7), (6, 4), (5, 4), (4, 4), (3, 1), (1, 1)] {
            assert_eq!(p.kept_at_points(p.outputs(), most).len(), number, "{most}");
        }
    }

    #[test]
    fn results_that_know_no_time_are_kept() {
        let p = program(&["sin(x)*y", "x*t"]);
        let kept = p.kept_at_points(p.outputs(), usize::MAX);
        assert!(kept.contains(&p.outputs()[0]), "{kept:?}");
    }

    /// By what is left to do at each time, where some values are kept.
    #[test]
    fn operations_are_counted_where_they_are_done() {
        let calls = |n: usize| OperationCount { calls: n, ..OperationCount::default() };
        let products =
            |n: usize| OperationCount { multiplications: n, ..OperationCount::default() };
        let p = program(&["cos(t)*sin(x*y)", "sin(x*y)^2"]);
        let find = |wanted: fn(&Operation) -> bool| -> Vec<Slot> {
            p.slots().filter(|slot| wanted(&p.operations()[slot.index()])).collect()
        };
        let coordinates = find(|o| matches!(o, Operation::Input(0 | 1)));
        let stages = p.operations_with_kept(p.outputs(), &coordinates);
        assert_eq!((stages.time, stages.point), (calls(1), calls(0)));
        assert_eq!(stages.both, OperationCount { calls: 1, ..products(3) });
        let mut kept: Vec<Slot> = p
            .slots()
            .filter(|&slot| {
                let position = Dependence { position: true, time: false };
                matches!(p.operations()[slot.index()], Operation::Call(..))
                    && p.dependence(slot) == position
            })
            .collect();
        let stages = p.operations_with_kept(p.outputs(), &kept);
        assert_eq!(stages.point, OperationCount { calls: 1, ..products(1) });
        assert_eq!((stages.time, stages.both), (calls(1), products(2)));
        kept.push(p.outputs()[1]);
        let stages = p.operations_with_kept(p.outputs(), &kept);
        assert_eq!(stages.point, OperationCount { calls: 1, ..products(2) });
        assert_eq!((stages.time, stages.both), (calls(1), products(1)));
    }

    /// The values that `outputs` need and that depend on the position alone.
    fn of_points(p: &Program) -> Vec<Slot> {
        let needed = p.needed(p.outputs());
        p.slots()
            .filter(|slot| needed[slot.index()])
            .filter(|&slot| p.dependence(slot) == Dependence { position: true, time: false })
            .collect()
    }

    /// The least that any set of values costs that all else follows from, where nothing is computed once a point and
    /// again each time.
    fn least_cost(p: &Program) -> Option<usize> {
        let here = of_points(p);
        let computed_twice = |kept: &[Slot]| {
            let below = p.needed(kept);
            let mut stack = p.outputs().to_vec();
            let mut anew = Vec::new();
            while let Some(slot) = stack.pop() {
                if !kept.contains(&slot) && !anew.contains(&slot) {
                    anew.push(slot);
                    stack.extend(p.operations()[slot.index()].operands());
                }
            }
            here.iter().any(|slot| below[slot.index()] && anew.contains(slot))
        };
        (0..1_usize << here.len())
            .map(|set| -> Vec<Slot> {
                (0..here.len()).filter(|n| set >> n & 1 == 1).map(|n| here[n]).collect()
            })
            .filter(|kept| !reads_coordinates(p, kept) && !computed_twice(kept))
            .map(|kept| cost(p, &kept))
            .min()
    }

    #[test]
    fn no_choice_is_cheaper() {
        for texts in [
            &["t*sin(x) + t^2*sin(x)*cos(x) + sin(x)*cos(x)^2*cos(t)"][..],
            &["(x + t)*(x^2 + t)*(x^3 + y + t)*(y*x + t)", "t*(x + y)"],
            &["t/(1 + x^2) + t^2*x/(1 + x^2) + cos(t)*y/(1 + x^2)^2"],
            &["x*y", "t*x*y + t^2*(x*y + 1)^2"],
        ] {
            let p = program(texts);
            let found = p.kept_at_points(p.outputs(), usize::MAX);
            assert!(of_points(&p).len() < 16, "too many to try all");
            assert_eq!(Some(cost(&p, &found)), least_cost(&p), "{texts:?}: {found:?}");
        }
    }

    fn text() -> impl Strategy<Value = String> {
        let leaf = prop::sample::select(&["x", "y", "t", "2"][..]).prop_map(str::to_owned);
        leaf.prop_recursive(4, 12, 2, |inner| {
            let pair = (inner.clone(), inner.clone());
            prop_oneof![
                pair.clone().prop_map(|(a, b)| format!("({a}) + ({b})")),
                pair.clone().prop_map(|(a, b)| format!("({a})*({b})")),
                pair.clone().prop_map(|(a, b)| format!("({a})*({b}) + t*({a})")),
                pair.prop_map(|(a, b)| format!("({a})/(1 + ({b})^2)")),
                inner.clone().prop_map(|a| format!("({a})^2 + t*({a})")),
                inner.prop_map(|a| format!("sin({a})")),
            ]
        })
    }

    proptest! {
        #[test]
        fn whatever_is_computed_no_choice_is_cheaper(first in text(), second in text()) {
            let p = program(&[&first, &second]);
            prop_assume!(of_points(&p).len() < 10);
            let found = p.kept_at_points(p.outputs(), usize::MAX);
            prop_assert!(!reads_coordinates(&p, &found));
            prop_assert_eq!(Some(cost(&p, &found)), least_cost(&p), "{}, {}: {:?}", first, second, found);
            // No more than there is room for, but the coordinates.
            for most in 2..found.len() {
                let kept = p.kept_at_points(p.outputs(), most);
                prop_assert!(kept.len() <= most && !reads_coordinates(&p, &kept), "{}, {}: {:?}", first, second, kept);
            }
        }
    }

    /// Whether an output still needs a coordinate that is not kept.
    fn reads_coordinates(p: &Program, kept: &[Slot]) -> bool {
        let mut stack = p.outputs().to_vec();
        while let Some(slot) = stack.pop() {
            if kept.contains(&slot) {
                continue;
            }
            let operation = &p.operations()[slot.index()];
            if matches!(operation, Operation::Input(0 | 1)) {
                return true;
            }
            stack.extend(operation.operands());
        }
        false
    }
}
