//! Problems whose every length, time and stiffness is a parameter with a unit.

use std::cell::RefCell;
use std::rc::Rc;

use mmsmith_interpret::{interpret_staged, interpret_staged_single};
use mmsmith_solutions::AnySolution;
use mmsmith_spec::Spec;
use mmsmith_stage::Staged;

/// Parameters that all problems have.
const PARAMETERS: &str = "\
A = { default = 0.05, unit = 'm' }
L = { default = 1.0, range = '> 0', unit = 'm' }
E = { default = 1.0e4, range = '> 0', unit = 'Pa' }
nu = { default = 0.3, range = '> -1, < 1/2' }
rho0 = { default = 3.0, range = '> 0', unit = 'kg/m^3' }
";

const NEO_HOOKEAN: &str = "law = 'neo-hookean'";

/// The laws of the library with their constants, and laws that files state, for motions in the plane and in space.
pub(super) const LAWS: &[(&str, &str)] = &[
    ("neo-hookean", NEO_HOOKEAN),
    ("st-venant-kirchhoff", "law = 'st-venant-kirchhoff'"),
    ("hencky", "law = 'hencky'"),
    ("linear-elastic", "law = 'linear-elastic'"),
    ("mooney-rivlin", "law = 'mooney-rivlin'\nc1 = 'E/6'\nc2 = 'E/20'\nlambda = 'E/2'"),
    (
        "yeoh",
        "law = 'yeoh'\nc1 = 'E/6'\nc2 = 'E/60'\nc3 = 'E/200'\nkappa = '2*E'\nvolumetric = 'mixed'",
    ),
    ("gent", "law = 'gent'\nJm = 3"),
    ("arruda-boyce", "law = 'arruda-boyce'\nmu = 'E/3'\nN = 5\nkappa = '2*E'"),
    (
        "ogden",
        "law = 'ogden'\nmu1 = 'E/3'\nalpha1 = 1.5\nmu2 = '-E/50'\nalpha2 = -2\nkappa = '2*E'",
    ),
    (
        "holzapfel-gasser-ogden",
        "law = 'holzapfel-gasser-ogden'\nmu = 'E/3'\nk1 = 'E/10'\nk2 = 0.5\nkappa = '2*E'\nangle = 0.3\nvolumetric = 'quadratic'",
    ),
    ("orthotropic", "law = 'orthotropic'\nc11 = '2*E'\nc22 = 'E'\nc12 = 'E/3'\nc66 = 'E/2'"),
    ("energy", "law = 'energy'\nW = 'E/4*(I1 - 3 - 2*ln(J)) + E/3*(J - 1)^2'"),
    ("graded", "law = 'neo-hookean'\nE = 'E*(1 + X/(2*L))'\ndensity = 'rho0*(1 + X/(3*L))'"),
];

/// Laws that remember: further parameters, and the law with its tables.
pub(super) const MEMORY: &[(&str, &str, &str)] = &[
    (
        "perzyna",
        "sy = { default = 20.0, unit = 'Pa' }\ns0 = { default = 200.0, unit = 'Pa' }\ntau = { default = 0.02, unit = 's' }\n",
        "law = 'hencky'\n[material.flow]\nkind = 'perzyna'\nyield = 'sy + E/20*alpha'\ndrag = 's0'\nexponent = 3\ntime = 'tau'",
    ),
    (
        "j2",
        "sy = { default = 40.0, unit = 'Pa' }\n",
        "law = 'hencky'\n[material.flow]\nkind = 'j2'\nyield = 'sy + E/20*alpha^(1/3)'",
    ),
    (
        "maxwell",
        "tau1 = { default = 0.002, unit = 's' }\ntau2 = { default = 0.02, unit = 's' }\n",
        "law = 'linear-elastic'\n[[material.maxwell]]\nshare = 0.3\ntime = 'tau1'\n[[material.maxwell]]\nshare = 0.2\ntime = 'tau2'",
    ),
    (
        "simo",
        "tau = { default = 0.005, unit = 's' }\n",
        "law = 'yeoh'\nc1 = 'E/6'\nc2 = 0\nkappa = '2*E'\n[[material.maxwell]]\nshare = 0.4\ntime = 'tau'",
    ),
    (
        "kelvin-voigt",
        "eta = { default = 2.0, unit = 'Pa s' }\n",
        "law = 'stress'\nP = { 11 = 'E/2*(F11 - 1/F11) + eta*d11/F11', 12 = 'E/3*F12', 21 = 'E/3*F21', 22 = 'E/2*(F22 - 1/F22) + eta*d22/F22' }",
    ),
    (
        "own",
        "tau = { default = 0.005, unit = 's' }\n",
        "law = 'stress'\nP = { 11 = 'E/2*(F11 - 1/F11) + E/3*(F11 - 1 - q)', 12 = 'E/3*F12', 21 = 'E/3*F21', 22 = 'E/2*(F22 - 1/F22)' }\n\
         [internal]\nq = { rate = '(F11 - 1 - q)/tau', initial = 0 }",
    ),
];

/// A body, with the motion that its boundary allows.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Body {
    /// Between walls.
    Line,
    Square,
    Cube,
    /// Free of walls, under the tractions of the motion.
    Loaded,
    LoadedCube,
    /// With sides that move as the motion does.
    Moved,
    Ring,
    /// With free rims, which the law without a lateral stress has.
    FreeRing,
    Shell,
    /// A thick cylinder that is axisymmetric, under the tractions of the motion.
    Cylinder,
    /// A thick cylinder between walls.
    Sleeve,
}

impl Body {
    pub(super) fn dimension(self) -> usize {
        match self {
            Self::Line => 1,
            Self::Square
            | Self::Loaded
            | Self::Moved
            | Self::Ring
            | Self::FreeRing
            | Self::Cylinder
            | Self::Sleeve => 2,
            Self::Cube | Self::LoadedCube | Self::Shell => 3,
        }
    }

    /// The number of lengths in a volume.
    pub(super) fn axes(self) -> usize {
        if matches!(self, Self::Cylinder | Self::Sleeve) { 3 } else { self.dimension() }
    }

    /// Coordinates, displacement and domain.
    fn parts(self) -> [&'static str; 3] {
        const PLANE: &str = "X = 'A*sin(Pi*X/L)*cos(Pi*Y/L)*sin(Pi*c*t/L)'\nY = 'A*cos(Pi*X/L)*sin(Pi*Y/L)*sin(Pi*c*t/L)/2'";
        const SPACE: &str = "X = 'A*sin(Pi*X/L)*cos(Pi*Y/L)*sin(Pi*c*t/L)'\nY = 'A*cos(Pi*X/L)*sin(Pi*Y/L)*sin(Pi*c*t/L)/2'\n\
                             Z = 'A*sin(Pi*Z/L)*(cos(Pi*c*t/L) - 1)/3'";
        match self {
            Self::Line => [
                "cartesian",
                "X = 'A*sin(Pi*X/L)*sin(Pi*c*t/L)'",
                "shape = 'box'\nlower = [0]\nupper = ['L']\ncell-length = 'L'",
            ],
            Self::Square | Self::Loaded | Self::Moved => [
                "cartesian",
                PLANE,
                "shape = 'box'\nlower = [0, 0]\nupper = ['L', 'L']\ncell-length = 'L'",
            ],
            Self::Cube | Self::LoadedCube => [
                "cartesian",
                SPACE,
                "shape = 'box'\nlower = [0, 0, 0]\nupper = ['L', 'L', 'L']\ncell-length = 'L'",
            ],
            Self::Ring => [
                "polar",
                "R = 'A*sin(c*Pi*t/L)*(L/R + R/L - 1/2)/2'",
                "shape = 'annulus'\ninner = 'L/2'\nouter = 'L'\ncell-length = 'L'",
            ],
            Self::FreeRing => [
                "polar",
                "R = 'A*cos(c*Pi*t/L)*(1 + (L - R)^2*(2*R - L/2)/(L^3/2))'",
                "shape = 'annulus'\ninner = 'L/2'\nouter = 'L'\ncell-length = 'L'",
            ],
            Self::Shell => [
                "spherical",
                "R = 'A*sin(c*Pi*t/L)*(R/L)^2*(3 - 2*R/L)'",
                "shape = 'shell'\ninner = 'L/2'\nouter = 'L'\ncell-length = 'L'",
            ],
            Self::Cylinder => [
                "axisymmetric",
                "R = 'A*sin(c*Pi*t/L)*(R/L)^2*(3 - 2*R/L)*cos(Pi*Z/L)'\nZ = 'A*sin(c*Pi*t/L)*(1 - R/L/2)*sin(Pi*Z/L)'",
                "shape = 'box'\nlower = ['L/2', 0]\nupper = ['L', 'L']\ncell-length = 'L'",
            ],
            Self::Sleeve => [
                "axisymmetric",
                "R = 'A*sin(c*Pi*t/L)*sin(2*Pi*(R - L/2)/L)*cos(Pi*Z/L)'\nZ = 'A*sin(c*Pi*t/L)*cos(2*Pi*(R - L/2)/L)*sin(Pi*Z/L)'",
                "shape = 'box'\nlower = ['L/2', 0]\nupper = ['L', 'L']\ncell-length = 'L'",
            ],
        }
    }

    /// The surfaces with their conditions.
    fn boundary(self) -> String {
        let axes = ["X", "Y", "Z"];
        let both = |axis: &str, condition: &str| {
            let side = |end: &str| {
                format!("[[boundary]]\nsurface = '{axis}-{end}'\ncondition = '{condition}'\n")
            };
            side("lower") + &side("upper")
        };
        let all = |condition: &str| -> String {
            axes[..self.dimension()].iter().map(|axis| both(axis, condition)).collect()
        };
        let of_round = |dimension: usize, rims: &'static str| -> String {
            let rims = ["inner", "outer"].map(|surface| (surface.to_owned(), rims));
            let planes = axes[..dimension].iter().map(|axis| (format!("{axis}-lower"), "symmetry"));
            let side = |(surface, condition): (String, &str)| {
                format!("[[boundary]]\nsurface = '{surface}'\ncondition = '{condition}'\n")
            };
            rims.into_iter().chain(planes).map(side).collect()
        };
        match self {
            Self::Line | Self::Square | Self::Cube => all("sliding"),
            Self::Loaded | Self::LoadedCube => all("prescribed-traction"),
            Self::Moved => both("X", "prescribed-motion") + &both("Y", "sliding"),
            Self::Ring => of_round(2, "prescribed-traction"),
            Self::FreeRing => of_round(2, "traction-free"),
            Self::Shell => of_round(3, "prescribed-traction"),
            Self::Cylinder => both("R", "prescribed-traction") + &both("Z", "sliding"),
            Self::Sleeve => both("R", "sliding") + &both("Z", "sliding"),
        }
    }
}

/// A body with a law.
pub(super) struct Problem {
    spec: Spec,
    staged: Staged,
    pub(super) told: String,
    /// Solutions by their units: histories of laws that remember are formed once.
    doubles: RefCell<Vec<(Scaling, Rc<AnySolution<f64>>)>>,
    singles: RefCell<Vec<(Scaling, Rc<AnySolution<f32>>)>>,
}

/// Powers of two by which lengths, roots of stiffness and roots of density are multiplied, so that times and velocities are too.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Scaling {
    pub(super) length: i32,
    pub(super) stiffness: i32,
    pub(super) density: i32,
}

/// The exponents of length, root of stiffness and root of density in a quantity.
pub(super) type Unit = [i32; 3];

pub(super) const LENGTH: Unit = [1, 0, 0];
pub(super) const VELOCITY: Unit = [0, 1, -1];
pub(super) const TIME: Unit = [1, -1, 1];
pub(super) const PURE: Unit = [0, 0, 0];
pub(super) const STRESS: Unit = [0, 2, 0];
pub(super) const ACCELERATION: Unit = [-1, 2, -2];

impl Scaling {
    pub(super) fn exponent(self, [length, stiffness, density]: Unit) -> i32 {
        length * self.length + stiffness * self.stiffness + density * self.density
    }

    /// Whether `b` is `a` in the other units, to the bit.
    pub(super) fn holds(self, unit: Unit, a: f64, b: f64) -> bool {
        let scaled = a * 2.0_f64.powi(self.exponent(unit));
        scaled.to_bits() == b.to_bits() || (scaled.is_nan() && b.is_nan())
    }
}

impl Problem {
    pub(super) fn new(body: Body, law: &str) -> Self {
        Self::with(body, "", law)
    }

    pub(super) fn with(body: Body, parameters: &str, law: &str) -> Self {
        let [coordinates, displacement, domain] = body.parts();
        let (dimension, boundary) = (body.dimension(), body.boundary());
        let text = format!(
            "name = 'units'\ntitle = 'Units'\ncoordinates = '{coordinates}'\ndimension = {dimension}\n[parameters]\n{PARAMETERS}{parameters}\
             [let]\nc = 'sqrt(E/rho0)'\n[displacement]\n{displacement}\n[material]\n{law}\n[domain]\n{domain}\n{boundary}\
             [time]\nperiod = '2*L/c'\nwave-speed = 'c'\n"
        );
        // The density of a law that does not tell its own.
        let text = match law.contains("density") {
            true => text,
            false => text.replace("[material]\n", "[material]\ndensity = 'rho0'\n"),
        };
        let spec =
            Spec::parse(&text, "units.toml").unwrap_or_else(|error| panic!("{error}\n{text}"));
        let fields = spec.derive().unwrap_or_else(|error| panic!("{error}\n{text}"));
        let staged = Staged::of(&spec, fields);
        let told = format!("{body:?}, {}", law.replace('\n', "; "));
        Self { spec, staged, told, doubles: RefCell::default(), singles: RefCell::default() }
    }

    /// With the law that all motions go with.
    pub(super) fn neo_hookean(body: Body) -> Self {
        let law = match body {
            Body::FreeRing => "law = 'neo-hookean'\nlambda = 0\nmu = 'E/2'",
            _ => NEO_HOOKEAN,
        };
        Self::new(body, law)
    }

    /// The values of the parameters in other units.
    fn values(&self, scaling: Scaling) -> Vec<(&str, f64)> {
        let value = |parameter: &mmsmith_spec::Parameter| {
            let unit = match parameter.unit.as_str() {
                "m" => LENGTH,
                "Pa" => STRESS,
                "kg/m^3" => [0, 0, 2],
                "s" => TIME,
                "Pa s" => [1, 1, 1],
                _ => PURE,
            };
            parameter.default * 2.0_f64.powi(scaling.exponent(unit))
        };
        self.spec.parameters.iter().map(|own| (own.name.as_str(), value(own))).collect()
    }

    pub(super) fn in_double(&self, scaling: Scaling) -> Rc<AnySolution<f64>> {
        kept(&self.doubles, scaling, || {
            interpret_staged(&self.spec, &self.staged, self.values(scaling))
                .unwrap_or_else(|error| panic!("{}: {error}", self.told))
        })
    }

    pub(super) fn in_single(&self, scaling: Scaling) -> Rc<AnySolution<f32>> {
        kept(&self.singles, scaling, || {
            interpret_staged_single(&self.spec, &self.staged, self.values(scaling))
                .unwrap_or_else(|error| panic!("{}: {error}", self.told))
        })
    }
}

/// The value of these units, made where it is missing.
fn kept<V>(
    known: &RefCell<Vec<(Scaling, Rc<V>)>>,
    scaling: Scaling,
    make: impl FnOnce() -> V,
) -> Rc<V> {
    let found = known.borrow().iter().find(|(own, _)| *own == scaling).map(|(_, v)| v.clone());
    found.unwrap_or_else(|| {
        let made = Rc::new(make());
        known.borrow_mut().push((scaling, made.clone()));
        made
    })
}
