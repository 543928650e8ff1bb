//! The table of mistakes, a row each.

use super::memory;
use super::planting::Planting;
use super::{Cause, Counter, Moved, Placed, Timed, Unused};
use mmsmith_expr::{Expr, Graph, Rational};

macro_rules! causes {
    ($($name:literal: $mistake:literal, $look:literal, $counter:expr;)+) => {
        /// Every mistake that is looked for, the likelier mistakes first.
        pub const CAUSES: &[Cause] = &[$(Cause {
            name: $name,
            mistake: $mistake,
            look: $look,
            counter: $counter,
        },)+];
    };
}

const fn fields(change: fn(&mut Planting<'_>)) -> Counter {
    Counter::Fields(change)
}

const fn memory(change: memory::Change) -> Counter {
    Counter::Memory(change)
}

const fn time(of: Timed, steps: f64) -> Counter {
    Counter::Time { of, steps }
}

causes! {
    // The body force.
    "force-sign": "the body force has the wrong sign",
        "the line that adds b: the balance is rho0 a = Div P + rho0 b, so b is added to the internal force -(P : grad N), not subtracted",
        fields(|p| p.balance([-1, 1, 0], [-1, 1, 0]));
    "force-per-volume": "the body force is multiplied by the density once too often",
        "the line that adds b: it is a force per mass. Where the nodal force is divided by the mass, rho0 b V is added; where an acceleration is formed, b alone",
        fields(|p| p.scale_force([1, 1, -1], 0));
    "force-per-volume-twice": "the body force is multiplied by the density twice too often",
        "the line that adds b: it is a force per mass, and rho0_b of generated code has the density already",
        fields(|p| p.scale_force([1, 1, -2], 0));
    "force-per-mass": "the body force lacks the density, or is divided by it",
        "the line that adds b: it is a force per mass, and a nodal force is rho0 b V, an integral over the volume with the density",
        fields(|p| p.scale_force([1, 1, 1], 0));
    "force-at-current-position": "the body force is evaluated at current positions",
        "the call of b: it takes the reference position X of the node, particle or quadrature point, not x = X + u",
        Counter::Place(Placed::Force);
    "force-step-ahead": "the body force is that of t + dt, one time step ahead",
        "the time in the call of b: the acceleration at t_n takes b(X, t_n), not t_(n+1); see where the time is incremented",
        time(Timed::Force, -1.0);
    "force-step-behind": "the body force is that of t - dt, one time step behind",
        "the time in the call of b: the acceleration at t_n takes b(X, t_n), not t_(n-1); see where the time is incremented",
        time(Timed::Force, 1.0);
    "force-half-step-ahead": "the body force is that of t + dt/2, half a time step ahead",
        "the time in the call of b: forces belong to the time of the displacements, not to that of the velocities between",
        time(Timed::Force, -0.5);
    "force-half-step-behind": "the body force is that of t - dt/2, half a time step behind",
        "the time in the call of b: forces belong to the time of the displacements, not to that of the velocities between",
        time(Timed::Force, 0.5);
    "force-halved": "the body force enters with half its size",
        "the weights of the integral of b: quadrature weights, the lumped load of a node, a factor 1/2 too many",
        fields(|p| p.scale_force([2, 1, 0], 0));
    "force-doubled": "the body force enters with twice its size",
        "the weights of the integral of b: quadrature weights, the lumped load of a node, a force that is added twice",
        fields(|p| p.scale_force([1, 2, 0], 0));
    "force-quartered": "the body force enters with a quarter of its size",
        "the weights of the integral of b: the weights of Gauss points add up to 4 on a square of side 2, to 1 on the unit square",
        fields(|p| p.scale_force([4, 1, 0], 0));
    "force-fourfold": "the body force enters with four times its size",
        "the weights of the integral of b: the weights of Gauss points add up to 4 on a square of side 2, to 1 on the unit square",
        fields(|p| p.scale_force([1, 4, 0], 0));
    "force-per-current-volume": "the body force is integrated over current volumes with the reference density",
        "the volume that multiplies b: rho0 b belongs to the reference volume V0, rho b to the current one, rho = rho0/J",
        fields(|p| p.scale_force([1, 1, 0], -1));
    "force-divided-by-J": "the body force is divided by J once too often",
        "the density that multiplies b: rho0 b belongs to the reference volume V0, rho b to the current one, rho = rho0/J",
        fields(|p| p.scale_force([1, 1, 0], 1));
    "force-components-exchanged": "the first two components of the body force are exchanged",
        "the storage of b: the order of components, rows for columns, or degrees of freedom numbered y before x",
        fields(|p| p.exchange_force());
    "force-coordinates-exchanged": "the body force is evaluated with X and Y exchanged",
        "the coordinates in the call of b: X first, then Y; a grid in the order [row, column] has Y first",
        fields(|p| p.exchange_coordinates());
    "force-X-sign": "the first component of the body force has the wrong sign",
        "the line that adds b_X",
        fields(|p| p.turn_force(0));
    "force-Y-sign": "the second component of the body force has the wrong sign",
        "the line that adds b_Y; gravity is often written with the sign of its direction",
        fields(|p| p.turn_force(1));
    "force-at-twice-the-time": "the body force is evaluated at twice the time",
        "the time in the call of b: t in the unit of the solution, incremented once in each step",
        fields(|p| p.scale_time_of_force(1, 2));
    "force-at-half-the-time": "the body force is evaluated at half the time",
        "the time in the call of b: t in the unit of the solution, incremented by the whole time step",
        fields(|p| p.scale_time_of_force(2, 1));
    "force-with-gravity": "gravity, 9.81 against the last axis, is added to the body force",
        "gravity that was left on: b is the whole body force",
        fields(|p| p.add_to_force(981, 100));
    "force-half-a-cell-off": "the body force is evaluated half a cell too far along every axis",
        "the points in the call of b: nodes for nodal forces, quadrature points for integrals; centres of cells lie half a cell beside nodes",
        Counter::Cell { cells: -0.5 };
    "force-half-a-cell-back": "the body force is evaluated half a cell too near to the origin",
        "the points in the call of b: nodes for nodal forces, quadrature points for integrals; centres of cells lie half a cell beside nodes",
        Counter::Cell { cells: 0.5 };
    "force-unused": "the body force has no effect on the result",
        "whether b is called, and whether its value reaches the acceleration",
        Counter::Unused(Unused::Force);
    "force-component-unused": "a component of the body force has no effect on the result",
        "the loop over the components where b is added",
        Counter::Unused(Unused::ForceComponent);
    "force-frozen": "the body force is evaluated at the start alone",
        "whether b is evaluated anew in each time step, with the time of that step",
        Counter::Unused(Unused::ForceLater);

    // Tractions.
    "traction-sign": "tractions have the wrong sign",
        "the line that adds tractions: P N with the outward normal N is added to the internal force",
        fields(|p| p.scale_tractions(-1, 1));
    "traction-halved": "tractions have half their size",
        "the weights of the integral over the surface: the length of an edge, the share of each of its nodes",
        fields(|p| p.scale_tractions(2, 1));
    "traction-doubled": "tractions have twice their size",
        "the weights of the integral over the surface: the length of an edge, half of it for each of its two nodes",
        fields(|p| p.scale_tractions(1, 2));
    "traction-quartered": "tractions have a quarter of their size",
        "the weights of the integral over the surface: the length of an edge, the share of each of its nodes",
        fields(|p| p.scale_tractions(4, 1));
    "traction-fourfold": "tractions have four times their size",
        "the weights of the integral over the surface: the length of an edge, half of it for each of its two nodes",
        fields(|p| p.scale_tractions(1, 4));
    "traction-times-density": "tractions are multiplied by the density",
        "the line that adds tractions: they are forces per area, and only b is multiplied by the density",
        fields(|p| p.scale_tractions_by_density(-1));
    "traction-over-density": "tractions are divided by the density once too often",
        "the line that adds tractions: they are forces per area, and are divided by the mass with all forces",
        fields(|p| p.scale_tractions_by_density(1));
    "traction-components-exchanged": "the first two components of tractions are exchanged",
        "the degrees of freedom that tractions are added to",
        fields(|p| p.exchange_tractions());
    "traction-per-current-area": "tractions are integrated over the current area",
        "the integral over the surface: tractions are forces per reference area",
        fields(|p| p.by_area(-1));
    "traction-divided-by-area-ratio": "tractions are divided by the ratio of current and reference area",
        "the integral over the surface: tractions are forces per reference area already",
        fields(|p| p.by_area(1));
    "traction-step-ahead": "tractions are those of t + dt, one time step ahead",
        "the time in the call of tractions: that of the displacements, t_n",
        time(Timed::Traction, -1.0);
    "traction-step-behind": "tractions are those of t - dt, one time step behind",
        "the time in the call of tractions: that of the displacements, t_n",
        time(Timed::Traction, 1.0);
    "traction-half-step-ahead": "tractions are those of t + dt/2, half a time step ahead",
        "the time in the call of tractions: that of the displacements, t_n",
        time(Timed::Traction, -0.5);
    "traction-half-step-behind": "tractions are those of t - dt/2, half a time step behind",
        "the time in the call of tractions: that of the displacements, t_n",
        time(Timed::Traction, 0.5);
    "traction-at-current-position": "tractions are evaluated at current positions",
        "the call of tractions: it takes reference positions X",
        Counter::Place(Placed::Traction);
    "traction-unused": "tractions have no effect on the result",
        "the surfaces whose condition is prescribed-traction: the traction P N is added to their nodal forces",
        Counter::Unused(Unused::Traction);
    "traction-frozen": "tractions are evaluated at the start alone",
        "whether tractions are evaluated anew in each time step, with the time of that step",
        Counter::Unused(Unused::TractionLater);

    // The stress.
    "stress-transposed": "the stress is transposed",
        "the contraction of the stress with the gradients of the shape functions: f_i = -sum_J P_iJ dN/dX_J, rows of P are directions in space. Also F stored by columns, or F^T for F in the law",
        fields(|p| p.stress(|d| { let P = d.P.clone(); d.transposed(&P) }));
    "stress-kirchhoff": "the Kirchhoff stress P F^T is taken for P",
        "the stress in the internal force: tau = P F^T belongs to gradients in the current configuration (dN/dx); with dN/dX it takes P = tau F^-T",
        fields(|p| p.stress(|d| { let (P, F) = (d.P.clone(), d.F.clone()); let T = d.transposed(&F); d.times(&P, &T) }));
    "stress-cauchy": "the Cauchy stress P F^T/J is taken for P",
        "the stress in the internal force: sigma belongs to gradients and volumes of the current configuration; with dN/dX and V0 it takes P = J sigma F^-T",
        fields(|p| p.stress(|d| { let (P, F) = (d.P.clone(), d.F.clone()); let T = d.transposed(&F); let tau = d.times(&P, &T); let inverse = d.J_to(-1); d.scaled(inverse, &tau) }));
    "stress-second-piola-kirchhoff": "the second Piola-Kirchhoff stress S = F^-1 P is taken for P",
        "the stress in the internal force: P = F S; the factor F is missing",
        fields(|p| p.stress(|d| { let P = d.P.clone(); let inverse = d.inverse(); d.times(&inverse, &P) }));
    "stress-times-J": "P is multiplied by J once too often",
        "powers of J in the stress or in the volumes: tau = J sigma, V = J V0; P goes with V0",
        fields(|p| p.stress(|d| { let (J, P) = (d.J_to(1), d.P.clone()); d.scaled(J, &P) }));
    "stress-over-J": "P is divided by J once too often",
        "powers of J in the stress or in the volumes: sigma = tau/J, V = J V0; P goes with V0",
        fields(|p| p.stress(|d| { let (J, P) = (d.J_to(-1), d.P.clone()); d.scaled(J, &P) }));
    "stress-with-current-gradients": "P is contracted with gradients in the current configuration",
        "the gradients of the shape functions in the internal force: P goes with dN/dX, tau and sigma with dN/dx",
        fields(|p| p.stress(|d| { let P = d.P.clone(); let f = d.inverse_transposed(); d.times(&P, &f) }));
    "stress-times-inverse": "the Kirchhoff stress is multiplied by F^-1 where F^-T is due",
        "P = tau F^-T: the inverse must be transposed",
        fields(|p| p.stress(|d| { let (P, F) = (d.P.clone(), d.F.clone()); let T = d.transposed(&F); let tau = d.times(&P, &T); let inverse = d.inverse(); d.times(&tau, &inverse) }));
    "stress-times-F": "P is multiplied by F from the right",
        "P = tau F^-T and P = F S: one factor F too many, or F for F^T",
        fields(|p| p.stress(|d| { let (P, F) = (d.P.clone(), d.F.clone()); d.times(&P, &F) }));
    "stress-F-times": "P is multiplied by F from the left",
        "P = F S: S is P already, and is multiplied by F once more",
        fields(|p| p.stress(|d| { let (P, F) = (d.P.clone(), d.F.clone()); d.times(&F, &P) }));
    "stress-shear-halved": "shear stresses have half their size",
        "shear strain: gamma_xy = 2 eps_xy; with tensor components the factor is 2 mu eps_xy, with engineering strains mu gamma_xy",
        fields(|p| p.stress(|d| { let P = d.P.clone(); d.shear_scaled(&P, 1, 2) }));
    "stress-shear-doubled": "shear stresses have twice their size",
        "shear strain: gamma_xy = 2 eps_xy; with tensor components the factor is 2 mu eps_xy, with engineering strains mu gamma_xy",
        fields(|p| p.stress(|d| { let P = d.P.clone(); d.shear_scaled(&P, 2, 1) }));
    "stress-without-shear": "shear stresses are missing",
        "the components of the stress that enter the internal force",
        fields(|p| p.stress(|d| { let P = d.P.clone(); d.shear_scaled(&P, 0, 1) }));

    // The constants of the law.
    "moduli-exchanged": "lambda and mu are exchanged",
        "the order of the arguments of the law",
        fields(|p| p.constants(|_, lambda, mu| (mu, lambda)));
    "plane-stress": "lambda is that of plane stress",
        "lambda = E nu/((1 + nu)(1 - 2 nu)) in plane strain and in space; E nu/(1 - nu^2) is that of plane stress",
        fields(|p| p.constants(|g, lambda, mu| { let [twice, sum] = [g.sum_of([mu, mu]), g.sum_of([lambda, mu, mu])]; let product = g.mul(lambda, twice); (g.div(product, sum), mu) }));
    "mu-doubled": "mu has twice its size",
        "mu = E/(2 (1 + nu)), and mu or 2 mu in the law: 2 mu goes with strains, mu with F F^T - I",
        fields(|p| p.constants(|g, lambda, mu| (lambda, g.sum_of([mu, mu]))));
    "mu-halved": "mu has half its size",
        "mu = E/(2 (1 + nu)), and mu or 2 mu in the law: 2 mu goes with strains, mu with F F^T - I",
        fields(|p| p.constants(|g, lambda, mu| { let two = g.integer(2); (lambda, g.div(mu, two)) }));
    "lambda-doubled": "lambda has twice its size",
        "lambda = E nu/((1 + nu)(1 - 2 nu)), and the factor of the volumetric part",
        fields(|p| p.constants(|g, lambda, mu| (g.sum_of([lambda, lambda]), mu)));
    "lambda-halved": "lambda has half its size",
        "lambda = E nu/((1 + nu)(1 - 2 nu)), and the factor of the volumetric part",
        fields(|p| p.constants(|g, lambda, mu| { let two = g.integer(2); (g.div(lambda, two), mu) }));
    "lambda-missing": "the part of the stress with lambda is missing",
        "the volumetric part of the law",
        fields(|p| p.constants(|g, _, mu| (g.integer(0), mu)));
    "lambda-sign": "the part of the stress with lambda has the wrong sign",
        "the sign of the volumetric part of the law",
        fields(|p| p.constants(|g, lambda, mu| (g.neg(lambda), mu)));
    "bulk-modulus-for-lambda": "the bulk modulus is taken for lambda",
        "lambda = K - 2 mu/3; E/(3 (1 - 2 nu)) is K",
        fields(|p| p.constants(|g, lambda, mu| { let two_thirds = two_thirds(g, mu); (g.add(lambda, two_thirds), mu) }));
    "p-wave-modulus-for-lambda": "lambda + 2 mu is taken for lambda",
        "lambda, the bulk modulus and the modulus of P-waves, lambda + 2 mu, are three constants",
        fields(|p| p.constants(|g, lambda, mu| (g.sum_of([lambda, mu, mu]), mu)));
    "bulk-modulus-without-two-thirds": "lambda is taken as K - mu, the relation of the plane",
        "lambda = K - 2 mu/3, also in plane strain",
        fields(|p| p.constants(|g, lambda, mu| { let third = { let two_thirds = two_thirds(g, mu); g.sub(mu, two_thirds) }; (g.sub(lambda, third), mu) }));
    "plane-bulk-modulus-for-lambda": "the bulk modulus of the plane, lambda + mu, is taken for lambda",
        "lambda, the bulk modulus and lambda + mu are three constants",
        fields(|p| p.constants(|g, lambda, mu| (g.add(lambda, mu), mu)));
    "E-and-nu-for-lambda-and-mu": "E and nu are taken for lambda and mu",
        "the arguments of the law: lambda = E nu/((1 + nu)(1 - 2 nu)), mu = E/(2 (1 + nu))",
        fields(|p| p.constants(young));
    "E-for-mu": "E is taken for mu",
        "mu = E/(2 (1 + nu))",
        fields(|p| p.constants(|g, lambda, mu| (lambda, young(g, lambda, mu).0)));
    "E-for-lambda": "E is taken for lambda",
        "lambda = E nu/((1 + nu)(1 - 2 nu))",
        fields(|p| p.constants(|g, lambda, mu| (young(g, lambda, mu).0, mu)));
    "mu-without-half": "mu = E/(2 nu + 1), or without the brackets",
        "mu = E/(2 (1 + nu)): the brackets",
        fields(|p| p.constants(|g, lambda, mu| { let (E, nu) = young(g, lambda, mu); let sum = g.sum_of([Graph::ONE, nu, nu]); (lambda, g.div(E, sum)) }));
    "mu-of-half-E": "mu = E/2",
        "mu = E/(2 (1 + nu)): the factor 1 + nu",
        fields(|p| p.constants(|g, lambda, mu| { let (E, _) = young(g, lambda, mu); let two = g.integer(2); (lambda, g.div(E, two)) }));
    "lambda-without-incompressibility": "lambda = E nu/(1 + nu), without the factor 1 - 2 nu",
        "lambda = E nu/((1 + nu)(1 - 2 nu))",
        fields(|p| p.constants(|g, lambda, mu| { let (E, nu) = young(g, lambda, mu); let sum = g.add(Graph::ONE, nu); let product = g.mul(E, nu); (g.div(product, sum), mu) }));
    "lambda-without-one-plus-nu": "lambda = E nu/(1 - 2 nu), without the factor 1 + nu",
        "lambda = E nu/((1 + nu)(1 - 2 nu))",
        fields(|p| p.constants(|g, lambda, mu| { let (_, nu) = young(g, lambda, mu); let sum = g.add(Graph::ONE, nu); (g.mul(lambda, sum), mu) }));
    "lambda-without-nu": "lambda = E/((1 + nu)(1 - 2 nu)), without the factor nu",
        "lambda = E nu/((1 + nu)(1 - 2 nu))",
        fields(|p| p.constants(|g, lambda, mu| { let (_, nu) = young(g, lambda, mu); (g.div(lambda, nu), mu) }));

    // The law.
    "law-neo-hookean": "the law is neo-Hookean, with lambda ln J",
        "the law: this solution has another one",
        fields(|p| p.law(|d, lambda, mu| { let f = d.inverse_transposed(); let log = d.log_J(); let pressure = d.product(&[lambda, log]); d.neo_hookean(mu, pressure, &f) }));
    "law-neo-hookean-J-minus-1": "the law is neo-Hookean, with lambda J (J - 1), of the energy lambda (J - 1)^2/2",
        "the volumetric part of the law: this solution has another one",
        fields(|p| p.law(|d, lambda, mu| { let f = d.inverse_transposed(); let one = d.number(1, 1); let (J, change) = (d.J, { let J = d.J; d.difference(J, one) }); let pressure = d.product(&[lambda, J, change]); d.neo_hookean(mu, pressure, &f) }));
    "law-neo-hookean-volume-change": "the law is neo-Hookean, with lambda (J - 1) for lambda ln J",
        "the volumetric part of the law: lambda ln J F^-T",
        fields(|p| p.law(|d, lambda, mu| { let f = d.inverse_transposed(); let one = d.number(1, 1); let change = { let J = d.J; d.difference(J, one) }; let pressure = d.product(&[lambda, change]); d.neo_hookean(mu, pressure, &f) }));
    "law-neo-hookean-J-squared": "the law is neo-Hookean, with lambda (J^2 - 1)/2",
        "the volumetric part of the law: this solution has another one",
        fields(|p| p.law(|d, lambda, mu| { let f = d.inverse_transposed(); let one = d.number(1, 1); let square = d.J_to(2); let change = d.difference(square, one); let half = d.number(1, 2); let pressure = d.product(&[half, lambda, change]); d.neo_hookean(mu, pressure, &f) }));
    "law-logarithm-to-base-10": "the logarithm of J is that to base 10",
        "the logarithm in the law: ln J",
        fields(|p| p.law(|d, lambda, mu| { let f = d.inverse_transposed(); let log = d.log_J(); let ten = d.number(10, 1); let base = d.log(ten); let shrunk = d.quotient(log, base); let pressure = d.product(&[lambda, shrunk]); d.neo_hookean(mu, pressure, &f) }));
    "law-inverse-not-transposed": "the neo-Hookean law has F^-1 for F^-T",
        "P = mu (F - F^-T) + lambda ln J F^-T: the inverse must be transposed",
        fields(|p| p.law(|d, lambda, mu| { let inverse = d.inverse(); let log = d.log_J(); let pressure = d.product(&[lambda, log]); d.neo_hookean(mu, pressure, &inverse) }));
    "law-right-for-left-cauchy-green": "the Kirchhoff stress is formed from C = F^T F for B = F F^T",
        "the order of the product: tau = mu (F F^T - I) + lambda ln J I",
        fields(|p| p.law(|d, lambda, mu| { let E = d.green_strain(); let two = d.number(2, 1); let twice = d.product(&[two, mu]); let shear = d.scaled(twice, &E); let log = d.log_J(); let pressure = d.product(&[lambda, log]); let identity = d.identity(); let volume = d.scaled(pressure, &identity); let tau = d.plus(&shear, &volume); let f = d.inverse_transposed(); d.times(&tau, &f) }));
    "law-without-stress-at-rest": "the neo-Hookean law lacks - mu F^-T, so that the body at rest has stresses",
        "P = mu (F - F^-T) + lambda ln J F^-T: at F = I it is zero",
        fields(|p| p.law(|d, lambda, mu| { let f = d.inverse_transposed(); let log = d.log_J(); let pressure = d.product(&[lambda, log]); let volume = d.scaled(pressure, &f); let F = d.F.clone(); let shear = d.scaled(mu, &F); d.plus(&shear, &volume) }));
    "law-st-venant-kirchhoff": "the law is St. Venant's and Kirchhoff's, P = F (lambda tr(E) I + 2 mu E)",
        "the law: this solution has another one",
        fields(|p| p.law(|d, lambda, mu| { let E = d.green_strain(); let S = d.hooke(lambda, mu, &E); let F = d.F.clone(); d.times(&F, &S) }));
    "law-without-F": "the stress is lambda tr(E) I + 2 mu E, without the factor F",
        "P = F S: S is the second Piola-Kirchhoff stress",
        fields(|p| p.law(|d, lambda, mu| { let E = d.green_strain(); d.hooke(lambda, mu, &E) }));
    "law-small-strain": "the law is that of small strains, lambda tr(eps) I + 2 mu eps",
        "the strain: this solution has large deformations",
        fields(|p| p.law(|d, lambda, mu| { let strain = d.small_strain(); d.hooke(lambda, mu, &strain) }));
    "strain-without-square": "Green's strain lacks its part of second order",
        "E = (H + H^T + H^T H)/2",
        fields(|p| p.law(|d, lambda, mu| { let strain = d.small_strain(); let S = d.hooke(lambda, mu, &strain); let F = d.F.clone(); d.times(&F, &S) }));
    "law-of-spatial-gradient": "the law is given F = I + du/dx, with the gradient in the current configuration",
        "the gradient in F: F = I + du/dX; of dN/dx comes F^-1 = I - du/dx",
        fields(|p| p.neo_hookean_of(|d| { let identity = d.identity(); let f = d.inverse(); let change = d.minus(&identity, &f); d.plus(&identity, &change) }));
    "law-of-inverse": "the law is given F^-1 for F",
        "F = dx/dX = I + du/dX, not dX/dx",
        fields(|p| p.neo_hookean_of(|d| d.inverse()));
    "law-of-symmetric-part": "the law is given the symmetric part of F",
        "F = I + du/dX: its part without symmetry, the rotation, belongs to it",
        fields(|p| p.neo_hookean_of(|d| { let strain = d.small_strain(); let identity = d.identity(); d.plus(&identity, &strain) }));
    "strain-sign": "the displacement gradient has the wrong sign",
        "F = I + du/dX, x = X + u, and the sign of the gradients of the shape functions",
        fields(|p| p.gradient(-1, 1));
    "strain-doubled": "the displacement gradient has twice its size",
        "the gradients of the shape functions: the derivative of the reference element's coordinate is 2/h on [-1, 1] and 1/h on [0, 1]",
        fields(|p| p.gradient(2, 1));
    "strain-halved": "the displacement gradient has half its size",
        "the gradients of the shape functions: the derivative of the reference element's coordinate is 2/h on [-1, 1] and 1/h on [0, 1]",
        fields(|p| p.gradient(1, 2));

    "shape-gradients-doubled": "the gradients of the shape functions have twice their size",
        "the derivative of the reference element's coordinate: 2/h on [-1, 1], and 1/h on [0, 1]",
        fields(|p| { p.gradient(2, 1); p.balance([1, 1, 0], [2, 1, 0]) });
    "shape-gradients-halved": "the gradients of the shape functions have half their size",
        "the derivative of the reference element's coordinate: 2/h on [-1, 1], and 1/h on [0, 1]",
        fields(|p| { p.gradient(1, 2); p.balance([1, 1, 0], [1, 2, 0]) });

    // Mass and the size of the internal force.
    "internal-force-doubled": "the internal force has twice its size, or the mass half of it",
        "quadrature weights and the determinant of the element's map in the internal force; the lumped mass rho0 V of a node",
        fields(|p| p.balance([1, 1, 0], [2, 1, 0]));
    "internal-force-halved": "the internal force has half its size, or the mass twice of it",
        "quadrature weights and the determinant of the element's map in the internal force; the lumped mass rho0 V of a node",
        fields(|p| p.balance([1, 1, 0], [1, 2, 0]));
    "internal-force-quartered": "the internal force has a quarter of its size, or the mass four times",
        "quadrature weights and the determinant of the element's map in the internal force; the lumped mass of a node is a quarter of each of its four elements",
        fields(|p| p.balance([1, 1, 0], [1, 4, 0]));
    "internal-force-fourfold": "the internal force has four times its size, or the mass a quarter",
        "quadrature weights and the determinant of the element's map in the internal force; the lumped mass of a node is a quarter of each of its four elements",
        fields(|p| p.balance([1, 1, 0], [4, 1, 0]));
    "internal-force-missing": "the internal force is missing",
        "whether the stress reaches the nodal forces",
        fields(|p| p.balance([1, 1, 0], [0, 1, 0]));
    "internal-force-sign": "the internal force has the wrong sign",
        "f = -sum P : grad N: the balance is rho0 a = Div P + rho0 b",
        fields(|p| p.balance([1, 1, 0], [-1, 1, 0]));
    "mass-halved": "the mass has half its size, with forces as they should be",
        "the lumped mass rho0 V of a node: quadrature weights, the share of each element",
        fields(|p| p.balance([1, 2, 0], [1, 1, 0]));
    "mass-doubled": "the mass has twice its size, with forces as they should be",
        "the lumped mass rho0 V of a node: quadrature weights, the share of each element, a mass that is added twice",
        fields(|p| p.balance([2, 1, 0], [1, 1, 0]));
    "mass-quartered": "the mass has a quarter of its size, with forces as they should be",
        "the lumped mass rho0 V of a node: a quarter of each of its four elements, not of one",
        fields(|p| p.balance([1, 4, 0], [1, 1, 0]));
    "mass-fourfold": "the mass has four times its size, with forces as they should be",
        "the lumped mass rho0 V of a node: a quarter of each of its four elements, not the whole",
        fields(|p| p.balance([4, 1, 0], [1, 1, 0]));
    "mass-without-density": "the mass lacks the density, with forces as they should be",
        "the mass rho0 V: the density",
        fields(|p| p.balance([1, 1, -1], [1, 1, 0]));
    "internal-force-without-density": "the internal force is not divided by the density, while b is added as an acceleration",
        "the acceleration Div P/rho0 + b, and the mass rho0 V",
        fields(|p| p.balance([1, 1, 0], [1, 1, 1]));
    "internal-force-per-density-twice": "the internal force is divided by the density twice, while b is added as an acceleration",
        "the acceleration Div P/rho0 + b, and the mass rho0 V: the density counts once",
        fields(|p| p.balance([1, 1, 0], [1, 1, -1]));
    "mass-with-density-twice": "the mass has the density twice, with forces as they should be",
        "the mass rho0 V: the density counts once",
        fields(|p| p.balance([1, 1, 1], [1, 1, 0]));
    "inertia-missing": "inertia is missing: the solver is a static one",
        "the acceleration in the balance rho0 a = Div P + rho0 b; a static solver takes a static solution",
        fields(|p| p.balance([0, 1, 0], [1, 1, 0]));
    "internal-force-step-ahead": "the internal force belongs to displacements one time step later than b",
        "the order of the steps: internal force and b at the same time, then velocities, then displacements",
        time(Timed::Inertia, -1.0);
    "internal-force-step-behind": "the internal force belongs to displacements one time step earlier than b",
        "the order of the steps: displacements must be moved by the new velocities (v += dt a, then u += dt v)",
        time(Timed::Inertia, 1.0);

    // Boundary values.
    "boundary-step-behind": "boundary values are those of t - dt, one time step behind",
        "the time in the call of u on the boundary: displacements that were moved to t_(n+1) take u(X, t_(n+1)), not t_n",
        time(Timed::Boundary, 1.0);
    "boundary-step-ahead": "boundary values are those of t + dt, one time step ahead",
        "the time in the call of u on the boundary: displacements at t_(n+1) take u(X, t_(n+1)), not t_(n+2)",
        time(Timed::Boundary, -1.0);
    "boundary-half-step-behind": "boundary values are those of t - dt/2, half a time step behind",
        "the time in the call of u on the boundary",
        time(Timed::Boundary, 0.5);
    "boundary-half-step-ahead": "boundary values are those of t + dt/2, half a time step ahead",
        "the time in the call of u on the boundary",
        time(Timed::Boundary, -0.5);
    "boundary-velocity-step-behind": "boundary velocities are those of t - dt, one time step behind",
        "the time in the call of v on the boundary: v at t + dt/2 moves displacements from t to t + dt",
        time(Timed::BoundaryVelocity, 1.0);
    "boundary-velocity-step-ahead": "boundary velocities are those of t + dt, one time step ahead",
        "the time in the call of v on the boundary: v at t + dt/2 moves displacements from t to t + dt",
        time(Timed::BoundaryVelocity, -1.0);
    "boundary-velocity-half-step-behind": "boundary velocities are those of t - dt/2, half a time step behind",
        "the time in the call of v on the boundary: v at t + dt/2, not at t, moves displacements from t to t + dt",
        time(Timed::BoundaryVelocity, 0.5);
    "boundary-velocity-half-step-ahead": "boundary velocities are those of t + dt/2, half a time step ahead",
        "the time in the call of v on the boundary: v at t + dt/2, not at t + dt, moves displacements from t to t + dt",
        time(Timed::BoundaryVelocity, -0.5);
    "boundary-sign": "boundary values have the wrong sign",
        "the line that sets displacements on the boundary",
        Counter::Motion(Moved::Sign);
    "boundary-halved": "boundary values have half their size",
        "the line that sets displacements on the boundary",
        Counter::Motion(Moved::Halved);
    "boundary-doubled": "boundary values have twice their size",
        "the line that sets displacements on the boundary: an increment that is added twice",
        Counter::Motion(Moved::Doubled);
    "boundary-components-exchanged": "the first two components of boundary values are exchanged",
        "the degrees of freedom of the boundary: those of x and y",
        Counter::Motion(Moved::Exchanged);
    "boundary-velocity-for-displacement": "displacements on the boundary are set to the velocity",
        "the call on the boundary: u(X, t) for displacements, v(X, t) for velocities",
        Counter::Motion(Moved::Velocity);
    "boundary-at-current-position": "boundary values are evaluated at current positions",
        "the call of u on the boundary: it takes reference positions X",
        Counter::Place(Placed::Boundary);
    "boundary-unused": "the boundary does not move as it should: u(X, t) on it has no effect on the result",
        "the prescribed displacement: it is u(X, t) on the surfaces whose condition is prescribed-motion, anew in each step, not zero and not u(X, 0)",
        Counter::Unused(Unused::Boundary);

    // Initial values.
    "initial-velocity-half-step-ahead": "the first velocity is that of t + dt/2, half a time step ahead",
        "the start of a staggered scheme: v(-dt/2) where the first step leads to v(dt/2), not v(0)",
        time(Timed::InitialVelocity, -0.5);
    "initial-velocity-half-step-behind": "the first velocity is that of t - dt/2, half a time step behind",
        "the start: v(0) where the first step is half a step, or v(dt/2), not v(-dt/2)",
        time(Timed::InitialVelocity, 0.5);
    "initial-velocity-step-ahead": "the first velocity is that of t + dt, one time step ahead",
        "the start of a staggered scheme: v(-dt/2), not v(dt/2)",
        time(Timed::InitialVelocity, -1.0);
    "initial-velocity-step-behind": "the first velocity is that of t - dt, one time step behind",
        "the start of a staggered scheme: v(dt/2), not v(-dt/2)",
        time(Timed::InitialVelocity, 1.0);
    "initial-velocity-sign": "the first velocity has the wrong sign",
        "the line that sets the first velocity",
        fields(|p| p.scale_velocity(-1, 1));
    "initial-velocity-halved": "the first velocity has half its size",
        "the line that sets the first velocity",
        fields(|p| p.scale_velocity(2, 1));
    "initial-velocity-doubled": "the first velocity has twice its size",
        "the line that sets the first velocity",
        fields(|p| p.scale_velocity(1, 2));
    "initial-velocity-missing": "the body starts at rest, without the first velocity",
        "the first velocity: v(X, 0), or v(X, -dt/2) for a staggered scheme, not zero",
        Counter::Impulse { steps: 1.0 };
    "initial-velocity-missing-first-half-step": "the body starts at rest, without the first velocity; the first step is half a step",
        "the first velocity: v(X, 0), not zero",
        Counter::Impulse { steps: 0.5 };
    "initial-velocity-unused": "the velocity at the start has no effect on the result",
        "the first velocity: v(X, 0), or v(X, -dt/2) for a staggered scheme, not zero",
        Counter::Unused(Unused::InitialVelocity);
    "initial-displacement-unused": "the displacement at the start has no effect on the result",
        "the first displacement: u(X, 0) at every point, not zero",
        Counter::Unused(Unused::InitialDisplacement);

    "initial-velocity-components-exchanged": "the first two components of the first velocity are exchanged",
        "the order of components in the line that sets the first velocity",
        fields(|p| p.exchange_velocity());

    // The memory of the material.
    "memory-unused": "the material is elastic: it does not flow, or its elements do not relax",
        "the update of the internal variables: it is called in every step, its result is kept, and the stress takes it",
        memory(memory::forget);
    "memory-hardening-unused": "the yield stress stays that of the start",
        "the equivalent plastic strain: alpha grows by sqrt(2/3) gamma in each return, is kept until the next step, and enters the yield stress",
        memory(|spec| memory::flow(spec, |_, flow| flow.modulus = Graph::ZERO));
    "memory-hardening-sign": "the hardening has the wrong sign: the material softens",
        "the yield stress, sy + K alpha^m, and the sign of K in the equation of the return",
        memory(|spec| memory::flow(spec, |graph, flow| flow.modulus = graph.neg(flow.modulus)));
    "memory-hardening-linear": "the exponent of the hardening is left out",
        "the yield stress, sy + K alpha^m: the power of alpha",
        memory(|spec| memory::flow(spec, |_, flow| flow.exponent = Graph::ONE));
    "memory-strain-without-two-thirds": "the equivalent plastic strain lacks the factor sqrt(2/3)",
        "alpha' = sqrt(2/3) gamma', where the plastic strain grows by gamma' n with |n| = 1",
        memory(|spec| memory::scale_strain(spec, 3, 2));
    "memory-strain-with-two-thirds-twice": "the equivalent plastic strain has the factor sqrt(2/3) twice",
        "alpha' = sqrt(2/3) gamma', where the plastic strain grows by gamma' n with |n| = 1",
        memory(|spec| memory::scale_strain(spec, 2, 3));
    "memory-radius-without-two-thirds": "the yield condition lacks the factor sqrt(2/3)",
        "f = |s| - sqrt(2/3) k, where k is the yield stress of a tension test",
        memory(memory::larger_radius);
    "memory-flow-time-halved": "the time of the flow is halved: it is twice as fast",
        "gamma' = <f/drag>^m / time, and a factor 2 in the viscosity",
        memory(|spec| memory::scale_flow_time(spec, 1, 2));
    "memory-flow-time-doubled": "the time of the flow is doubled: it is half as fast",
        "gamma' = <f/drag>^m / time, and a factor 1/2 in the viscosity",
        memory(|spec| memory::scale_flow_time(spec, 2, 1));
    "memory-flow-exponent-unused": "the exponent of the flow is left out",
        "gamma' = <f/drag>^m / time: the power m of the overstress",
        memory(|spec| memory::overstress(spec, |_, own| own.exponent = Graph::ONE));
    "memory-flow-exponent-inverse": "the exponent of the flow is 1/m",
        "gamma' = <f/drag>^m / time: the power m of the overstress, of which some codes take the inverse",
        memory(|spec| memory::overstress(spec, |graph, own| own.exponent = graph.powi(own.exponent, -1)));
    "memory-relaxation-time-halved": "the relaxation times are halved",
        "the exponential, exp(-dt/tau), or the factor of the implicit step, 1/(1 + dt/tau): a step that is added twice",
        memory(|spec| memory::scale_elements(spec, [1, 2], [1, 1]));
    "memory-relaxation-time-doubled": "the relaxation times are doubled",
        "the exponential, exp(-dt/tau): dt/2 belongs to the factor of the new stress alone, exp(-dt/(2 tau))",
        memory(|spec| memory::scale_elements(spec, [2, 1], [1, 1]));
    "memory-relaxation-time-inverse": "the relaxation times are taken for rates",
        "the exponential, exp(-dt/tau), not exp(-dt tau)",
        memory(|spec| memory::elements(spec, |graph, all| all.iter_mut().for_each(|own| own.time = graph.powi(own.time, -1))));
    "memory-shares-halved": "the elements have half their shares",
        "the shares g_i: those of the shear modulus at the start; 1 - sum g_i is left in the end",
        memory(|spec| memory::scale_elements(spec, [1, 1], [1, 2]));
    "memory-first-element-alone": "the first element alone relaxes",
        "the loop over elements, and the place where each keeps its variables",
        memory(|spec| memory::elements(spec, |_, all| all.truncate(1)));
    "memory-elements-exchanged": "the elements have each other's relaxation times",
        "the order of shares and times",
        memory(|spec| memory::elements(spec, |_, all| { let times: Vec<Expr> = all.iter().rev().map(|own| own.time).collect(); all.iter_mut().zip(times).for_each(|(own, time)| own.time = time) }));
    "memory-rates-unused": "the internal variables stay as they are at the start",
        "the update of the internal variables: it is called in every step, and its result is kept",
        memory(|spec| memory::scale_rates(spec, 0, 1));
    "memory-rates-halved": "the internal variables change half as fast",
        "the time step of the update of the internal variables",
        memory(|spec| memory::scale_rates(spec, 1, 2));
    "memory-rates-doubled": "the internal variables change twice as fast",
        "the time step of the update of the internal variables, and whether it is called twice in a step",
        memory(|spec| memory::scale_rates(spec, 2, 1));

    // The result.
    "result-step-behind": "the result is that of t - dt, one time step behind the time that is told with it",
        "the time that is written with the result: that of the displacements; see where the time is incremented, and how many steps there are",
        time(Timed::Everything, 1.0);
    "result-step-ahead": "the result is that of t + dt, one time step ahead of the time that is told with it",
        "the time that is written with the result: that of the displacements; see where the time is incremented, and how many steps there are",
        time(Timed::Everything, -1.0);
    "result-half-step-behind": "the result is that of t - dt/2, half a time step behind the time that is told with it",
        "the time that is written with the result: that of the displacements, not of the velocities between",
        time(Timed::Everything, 0.5);
    "result-half-step-ahead": "the result is that of t + dt/2, half a time step ahead of the time that is told with it",
        "the time that is written with the result: that of the displacements, not of the velocities between",
        time(Timed::Everything, -0.5);
}

fn two_thirds(graph: &mut Graph, mu: Expr) -> Expr {
    let number = graph.number(Rational::new(2.into(), 3.into()));
    graph.mul(number, mu)
}

/// Young's modulus and Poisson's ratio.
fn young(graph: &mut Graph, lambda: Expr, mu: Expr) -> (Expr, Expr) {
    let sum = graph.add(lambda, mu);
    let three = graph.integer(3);
    let thrice = graph.mul(three, lambda);
    let numerator = graph.sum_of([thrice, mu, mu]);
    let product = graph.mul(mu, numerator);
    let twice = graph.sum_of([sum, sum]);
    (graph.div(product, sum), graph.div(lambda, twice))
}
