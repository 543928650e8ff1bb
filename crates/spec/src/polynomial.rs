//! Displacements that finite elements represent exactly.

use crate::Fields;
use mmsmith_expr::{Derivatives, Expr, Graph};
use std::collections::BTreeMap;

impl Fields {
    /// The degree of the displacement as a polynomial in the Cartesian coordinates, of all coordinates together, at every time;
    /// `None` where it is no polynomial, or one of a degree above `most`.
    ///
    /// The space of elements of that degree holds it: its error is that of the time integration and of the quadrature, and no
    /// order in space shows.
    #[must_use]
    pub fn polynomial_degree(&self, most: usize) -> Option<usize> {
        let mut graph = self.graph.clone();
        let definitions: BTreeMap<Expr, Expr> = self.definitions.iter().copied().collect();
        let mut derivatives = Derivatives::default();
        let mut of_order: Vec<Expr> =
            self.u.iter().map(|&component| graph.replace(component, &definitions)).collect();
        (0..=most).find(|_| {
            let mut next = Vec::new();
            for &expression in &of_order {
                for (X, _) in &self.inputs[..self.u.len()] {
                    next.push(derivatives.of(&mut graph, expression, *X));
                }
            }
            next.retain(|derivative| *derivative != Graph::ZERO);
            next.sort_unstable();
            next.dedup();
            of_order = next;
            of_order.is_empty()
        })
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use crate::Spec;

    #[test]
    fn degrees_are_those_of_all_coordinates_together() {
        let cases = [
            ("sin(t)", "0", Some(0)),
            ("t*X - Y", "X*t^2", Some(1)),
            ("t*X*Y", "0", Some(2)),
            ("(X + t)^3", "Y", Some(3)),
            ("X^4", "Y", None),
            ("X*sin(Y*t)", "0", None),
            ("X/(1 + Y)", "0", None),
        ];
        for (X, Y, degree) in cases {
            let text = format!(
                "name = 'test'\ntitle = 'Test'\ncoordinates = 'cartesian'\ndimension = 2\n\
                 [displacement]\nX = '{X}'\nY = '{Y}'\n\
                 [material]\nlaw = 'neo-hookean'\nlambda = 1\nmu = 1\ndensity = 1\n\
                 [domain]\nshape = 'box'\nlower = [0, 0]\nupper = [1, 1]\n\
                 [time]\nperiod = 1\nwave-speed = 1\n"
            );
            let spec = Spec::parse(&text, "test.toml").unwrap();
            assert_eq!(spec.derive().unwrap().polynomial_degree(3), degree, "{X}, {Y}");
        }
    }
}
