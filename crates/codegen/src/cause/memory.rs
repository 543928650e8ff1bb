//! Mistakes in the memory of a material: a specification whose material makes them.

use mmsmith_expr::{Expr, Graph, Rational};
use mmsmith_spec::Spec;
use mmsmith_vocabulary::{Element, Flow, Memory, Overstress};

/// Another specification of the same motion; what it cannot change it leaves as it is.
pub(super) type Change = fn(&mut Spec);

fn fraction(graph: &mut Graph, numerator: i64, denominator: i64) -> Expr {
    graph.number(Rational::new(numerator.into(), denominator.into()))
}

/// Changes a material that flows.
pub(super) fn flow(spec: &mut Spec, change: impl FnOnce(&mut Graph, &mut Flow<Expr>)) {
    if let Some(Memory::Flow(flow)) = &mut spec.memory {
        change(&mut spec.graph, flow);
    }
}

/// The hardening with `alpha` times the square root of a fraction.
pub(super) fn scale_strain(spec: &mut Spec, numerator: i64, denominator: i64) {
    flow(spec, |graph, flow| {
        let base = fraction(graph, numerator, denominator);
        let root = graph.sqrt(base);
        let power = match graph.as_number(flow.exponent).cloned() {
            Some(exponent) => graph.product([(root, exponent)]),
            None => return,
        };
        flow.modulus = graph.mul(flow.modulus, power);
    });
}

/// The yield stress times the square root of 3/2. A body that starts on its yield surface keeps its own.
pub(super) fn larger_radius(spec: &mut Spec) {
    flow(spec, |graph, flow| {
        if flow.is_on_yield {
            return;
        }
        let base = fraction(graph, 3, 2);
        let root = graph.sqrt(base);
        for stress in [&mut flow.yield_stress, &mut flow.modulus] {
            *stress = graph.mul(*stress, root);
        }
    });
}

/// Changes the flow beyond the yield stress.
pub(super) fn overstress(spec: &mut Spec, change: impl FnOnce(&mut Graph, &mut Overstress<Expr>)) {
    flow(spec, |graph, flow| {
        if let Some(overstress) = &mut flow.overstress {
            change(graph, overstress);
        }
    });
}

/// The time of the flow times a fraction.
pub(super) fn scale_flow_time(spec: &mut Spec, numerator: i64, denominator: i64) {
    overstress(spec, |graph, overstress| {
        let factor = fraction(graph, numerator, denominator);
        overstress.time = graph.mul(factor, overstress.time);
    });
}

/// Changes Maxwell elements.
pub(super) fn elements(spec: &mut Spec, change: impl FnOnce(&mut Graph, &mut Vec<Element<Expr>>)) {
    if let Some(Memory::Maxwell(elements)) = &mut spec.memory {
        change(&mut spec.graph, elements);
    }
}

/// Relaxation times and shares times fractions.
pub(super) fn scale_elements(spec: &mut Spec, time: [i64; 2], share: [i64; 2]) {
    elements(spec, |graph, elements| {
        let [time, share] = [time, share].map(|[a, b]| fraction(graph, a, b));
        for element in elements {
            element.time = graph.mul(time, element.time);
            element.share = graph.mul(share, element.share);
        }
    });
}

/// An elastic material, but for a ten-billionth: elements hardly relax, and what flows does so as slowly, or hardens as steeply. The fields keep their
/// histories, and files for hosts their functions.
pub(super) fn forget(spec: &mut Spec) {
    const STEEP: i64 = 10_000_000_000;
    scale_elements(spec, [STEEP, 1], [1, 1]);
    flow(spec, |graph, flow| {
        let factor = fraction(graph, STEEP, 1);
        match &mut flow.overstress {
            Some(overstress) => overstress.time = graph.mul(factor, overstress.time),
            None => {
                flow.modulus = graph.mul(factor, flow.yield_stress);
                flow.exponent = fraction(graph, 1, 1);
            }
        }
    });
}

/// Rates of the internal variables of a stated law times a fraction.
pub(super) fn scale_rates(spec: &mut Spec, numerator: i64, denominator: i64) {
    let factor = fraction(&mut spec.graph, numerator, denominator);
    for variable in &mut spec.internal {
        variable.rate = spec.graph.mul(factor, variable.rate);
    }
}
