//! Scalars that are components of one vector or tensor, joined by their names.
//!
//! Programs write `ux, uy`, `disp_x, disp_y`, `u1, u2`, `velocity:0, velocity:1`, `sigma_xx, sigma_xy` or `S11, S22, S12` in place of
//! one array. The names are the same in tables and in VTK files, and so are the rules.

use std::collections::BTreeMap;

/// The name of the array that holds the positions.
pub(super) const POINTS: &str = "Points";
/// The name of the array that holds reference positions given by `X`, `Y`, `Z`.
pub(super) const REFERENCE: &str = "X";

/// An array as it is offered: each component comes from an array of the file, or is zero.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Joined {
    pub(super) name: String,
    pub(super) components: Vec<Option<Source>>,
}

/// A component of an array of the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Source {
    pub(super) array: usize,
    pub(super) component: usize,
}

/// Scalars whose names promise a vector or a tensor that lacks components.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Incomplete {
    pub(super) name: String,
    pub(super) members: Vec<String>,
}

/// The place of a component.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Component {
    Index(usize),
    Vector(usize),
    Tensor(usize, usize),
}

/// Names of vectors that a component may follow without a separator: `u1`, `ux`, `dispx`.
const VECTORS: [&str; 9] = ["u", "v", "U", "V", "disp", "displacement", "vel", "velocity", "coord"];
/// Names of tensors that a component may follow without a separator: `F11`, `S12`, `sigmaxx`.
const TENSORS: [&str; 10] = ["F", "P", "S", "s", "H", "sigma", "tau", "stress", "cauchy", "pk1"];
/// Names of vectors whose components are coordinates of the points.
const POSITIONS: [&str; 7] =
    ["coord", "coords", "coordinate", "position", "pos", "point", "points"];
/// Names of normal stresses whose shear stresses have the names in [`SHEARS`], as engineers write them.
const STRESSES: [&str; 4] = ["stress", "sigma", "s", "S"];
const SHEARS: [&str; 3] = ["tau", "shear", "shear_stress"];
/// Names whose missing components are a mistake for certain.
const CERTAIN: [&str; 6] = [POINTS, REFERENCE, "u", "v", "F", "P"];

fn axis(letter: u8) -> Option<usize> {
    b"xyz".iter().position(|axis| *axis == letter.to_ascii_lowercase())
}

fn digit(letter: u8) -> Option<usize> {
    b"123".iter().position(|digit| *digit == letter)
}

/// The meaning of a component's ending.
fn component(ending: &str) -> Option<Component> {
    match ending.as_bytes() {
        [c] => axis(*c).map(Component::Vector),
        [i, j] => {
            let pair = axis(*i).zip(axis(*j)).or_else(|| digit(*i).zip(digit(*j)));
            pair.map(|(i, j)| Component::Tensor(i, j))
        }
        _ => None,
    }
}

/// The array and the component that a name stands for; `None` where it is an array by itself.
fn split(name: &str) -> Option<(&str, Component)> {
    match name {
        "x" | "y" | "z" | "xu" | "yu" | "zu" => return Some((POINTS, component(&name[..1])?)),
        "X" | "Y" | "Z" | "x0" | "y0" | "z0" | "X0" | "Y0" | "Z0" => {
            return Some((REFERENCE, component(&name[..1])?));
        }
        _ => (),
    }
    // ParaView's table writer and many scripts name components so.
    if let Some((base, index)) = name.rsplit_once(':') {
        let index = index.parse().ok().map(Component::Index);
        return index.or_else(|| component(&name[base.len() + 1..])).map(|c| (placed(base), c));
    }
    if let Some((base, ending)) = bracketed(name) {
        let index = || ending.parse().ok().filter(|index| *index <= 9).map(Component::Index);
        return component(ending).or_else(index).map(|component| (placed(base), component));
    }
    let signs = ['_', ' ', '-', '.'];
    if let Some((base, ending)) = name.rsplit_once(signs).filter(|(base, _)| !base.is_empty()) {
        let index = || ending.parse().ok().filter(|index| *index <= 9).map(Component::Index);
        return component(ending).or_else(index).map(|component| (placed(base), component));
    }
    if let Some(parts) = capital(name) {
        return Some(parts);
    }
    for base in VECTORS {
        if let [c] = name.strip_prefix(base).unwrap_or_default().as_bytes()
            && let Some(index) = axis(*c).or_else(|| digit(*c))
        {
            return Some((placed(base), Component::Vector(index)));
        }
    }
    TENSORS.into_iter().find_map(|base| {
        let ending = name.strip_prefix(base).filter(|ending| ending.len() == 2)?;
        component(ending).map(|component| (base, component))
    })
}

/// The columns of a body of revolution: the names of radius and height, and of the angle between them.
const REVOLUTION: [(&str, &str, &str, &str); 2] =
    [(REFERENCE, "R", "Z", "theta"), (POINTS, "r", "z", "theta")];

/// As [`split`], of names among which there may be the columns of a body of revolution: `R, Z`, or `R, theta, Z` with components along these.
fn split_among<'a>(name: &'a str, names: &[&str]) -> Option<(&'a str, Component)> {
    for (base, radius, height, angle) in REVOLUTION {
        let has = |name: &str| names.contains(&name);
        if !(has(radius) && has(height)) {
            continue;
        }
        let is_of_space = has(angle) && base == REFERENCE;
        match name {
            _ if name == radius => return Some((base, Component::Vector(0))),
            _ if name == height => {
                return Some((base, Component::Vector(1 + usize::from(is_of_space))));
            }
            _ if name == angle && is_of_space => return Some((base, Component::Vector(1))),
            _ => (),
        }
    }
    split(name)
}

/// A component in brackets, as in `displacement[0]` and `stress(xy)`.
fn bracketed(name: &str) -> Option<(&str, &str)> {
    let (base, ending) = [('[', ']'), ('(', ')')]
        .iter()
        .find_map(|(open, close)| name.strip_suffix(*close)?.rsplit_once(*open))?;
    let base = base.trim_end();
    (!base.is_empty()).then_some((base, ending))
}

/// A component in capitals behind a small letter, as in `DispX` and `StressXY`.
fn capital(name: &str) -> Option<(&str, Component)> {
    let base = name.trim_end_matches(['X', 'Y', 'Z']);
    let is_word = base.len() > 2 && base.ends_with(|letter: char| letter.is_ascii_lowercase());
    let component = component(name.strip_prefix(base).filter(|_| is_word)?)?;
    Some((placed(base), component))
}

/// The name of the array; a name for positions is that of the points.
fn placed(base: &str) -> &str {
    match POSITIONS.iter().any(|name| name.eq_ignore_ascii_case(base)) {
        true => POINTS,
        false => base,
    }
}

/// The components in their order, if they form a vector or a tensor.
fn whole(members: &[(Component, usize)]) -> Option<Vec<Option<usize>>> {
    let Component::Tensor(..) = members[0].0 else { return whole_vector(members) };
    let mut entries = BTreeMap::new();
    for (component, index) in members {
        let Component::Tensor(i, j) = component else { return None };
        if entries.insert((*i, *j), *index).is_some() {
            return None;
        }
    }
    let size = 1 + entries.keys().map(|(i, j)| *i.max(j)).max()?;
    let at = |i: usize, j: usize| entries.get(&(i, j)).copied();
    let full = |n: usize| (0..n * n).all(|k| at(k / n, k % n).is_some());
    let (in_plane, count) = (full(2), entries.len());
    if full(size) {
        return Some((0..size * size).map(|k| at(k / size, k % size)).collect());
    }
    // The third direction of plane strain stands apart.
    if size == 3 && in_plane && count == 5 && at(2, 2).is_some() {
        return Some((0..9).map(|k| at(k / 3, k % 3)).collect());
    }
    symmetric(size, count, &at)
}

/// The different components of a symmetric tensor: XX, YY, XY, or XX, YY, ZZ, XY, YZ, XZ, of which shear out of the plane may be left
/// out.
fn symmetric(
    size: usize,
    count: usize,
    at: &impl Fn(usize, usize) -> Option<usize>,
) -> Option<Vec<Option<usize>>> {
    let either = |i, j| match (at(i, j), at(j, i)) {
        (Some(one), None) | (None, Some(one)) => Some(one),
        _ => None,
    };
    let shear = [either(0, 1), either(1, 2), either(0, 2)];
    let diagonal = [at(0, 0), at(1, 1), at(2, 2)];
    let found = diagonal.iter().chain(&shear).flatten().count();
    let is_plane = size == 2 && found == 3;
    let is_solid = size == 3 && shear[0].is_some() && shear[1].is_some() == shear[2].is_some();
    if found != count || diagonal[..size].iter().any(Option::is_none) || !(is_plane || is_solid) {
        return None;
    }
    match is_plane {
        true => Some(vec![diagonal[0], diagonal[1], shear[0]]),
        false => Some(diagonal.into_iter().chain(shear).collect()),
    }
}

/// Components by axis or by index, which may count from one.
fn whole_vector(members: &[(Component, usize)]) -> Option<Vec<Option<usize>>> {
    let index = |member: &(Component, usize)| match member.0 {
        Component::Index(index) | Component::Vector(index) => Some(index),
        Component::Tensor(..) => None,
    };
    let first = index(&members[0])?;
    let from_one = members.len() > 1 && matches!(members[0].0, Component::Index(1));
    if first != usize::from(from_one) {
        return None;
    }
    let counts = members.iter().enumerate().all(|(at, member)| index(member) == Some(at + first));
    counts.then(|| members.iter().map(|(_, index)| Some(*index)).collect())
}

/// Joins shear stresses with normal stresses that have another name.
fn join_shears(members: &mut BTreeMap<&str, Vec<(Component, usize)>>) {
    let diagonal = |members: &[(Component, usize)], is: bool| {
        members.iter().all(|(c, _)| matches!(c, Component::Tensor(i, j) if (i == j) == is))
    };
    let normal =
        STRESSES.iter().find(|name| members.get(**name).is_some_and(|m| diagonal(m, true)));
    let shear = SHEARS.iter().find(|name| members.get(**name).is_some_and(|m| diagonal(m, false)));
    if let Some((normal, shear)) = normal.zip(shear) {
        let shears = members.remove(shear).unwrap_or_default();
        members.entry(normal).or_default().extend(shears);
    }
}

/// Displacements `u, v, w` beside coordinates in as many directions are one vector.
fn join_uvw(names: &[&str], members: &mut BTreeMap<&str, Vec<(Component, usize)>>) {
    let axes = [POINTS, REFERENCE].iter().filter_map(|name| members.get(name)).map(Vec::len).max();
    let letters = ["u", "v", "w"];
    let found: Vec<_> =
        letters.iter().map_while(|letter| names.iter().position(|name| name == letter)).collect();
    let alone = |letter: &&str| members.get(letter).is_some_and(|members| members.len() == 1);
    let count = found.len();
    if count < 2
        || !axes.is_some_and(|axes| (2..=count).contains(&axes))
        || !letters[..count].iter().all(alone)
    {
        return;
    }
    for letter in &letters[1..count] {
        members.remove(letter);
    }
    let vector = found.into_iter().enumerate().map(|(axis, at)| (Component::Vector(axis), at));
    members.insert("u", vector.collect());
}

/// The arrays formed by arrays with these names and numbers of components, in their order, and the incomplete arrays.
pub(super) fn join(arrays: &[(&str, usize)]) -> (Vec<Joined>, Vec<Incomplete>) {
    let mut order: Vec<&str> = vec![];
    let mut members: BTreeMap<&str, Vec<(Component, usize)>> = BTreeMap::new();
    let taken: Vec<_> =
        arrays.iter().filter(|(_, count)| *count > 1).map(|(name, _)| *name).collect();
    let names: Vec<_> = arrays.iter().map(|(name, _)| *name).collect();
    for (index, (name, count)) in arrays.iter().enumerate() {
        let parts =
            split_among(name, &names).filter(|(base, _)| *count == 1 && !taken.contains(base));
        let (base, component) = parts.unwrap_or((name, Component::Index(0)));
        if !members.contains_key(base) {
            order.push(base);
        }
        members.entry(base).or_default().push((component, index));
    }
    join_shears(&mut members);
    join_uvw(&names, &mut members);
    let (mut joined, mut incomplete) = (vec![], vec![]);
    for base in order {
        let Some(mut components) = members.remove(base) else { continue };
        components.sort_unstable();
        if let [(_, index)] = components[..]
            && arrays[index].0 == base
        {
            joined.push(alone(arrays, index));
            continue;
        }
        if let Some(columns) = whole(&components) {
            let source = |array| Source { array, component: 0 };
            // Of an axisymmetric body all angles are alike: at the angle zero components along R, theta and Z are those in space.
            let is_angle = |column: &usize| base == REFERENCE && names[*column] == "theta";
            let known = |column: Option<usize>| column.filter(|column| !is_angle(column));
            let components = columns.into_iter().map(|column| known(column).map(source)).collect();
            joined.push(Joined { name: base.to_owned(), components });
            continue;
        }
        let mut indices: Vec<_> = components.iter().map(|(_, index)| *index).collect();
        indices.sort_unstable();
        if CERTAIN.contains(&base) {
            let members = indices.iter().map(|index| names[*index].to_owned()).collect();
            incomplete.push(Incomplete { name: base.to_owned(), members });
        }
        // Names that end like components but form no array.
        joined.extend(indices.into_iter().map(|index| alone(arrays, index)));
    }
    (joined, incomplete)
}

/// An array as it stands in the file.
fn alone(arrays: &[(&str, usize)], array: usize) -> Joined {
    let (name, count) = arrays[array];
    let components = (0..count).map(|component| Some(Source { array, component })).collect();
    Joined { name: name.to_owned(), components }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The arrays that scalars of these names make: the name and the places of the components, a dot for zero.
    fn told(names: &str) -> String {
        let names: Vec<_> = names.split(' ').map(|name| (name, 1)).collect();
        let place =
            |source: &Option<Source>| source.map_or(".".into(), |source| source.array.to_string());
        let array = |joined: &Joined| {
            let places: Vec<_> = joined.components.iter().map(place).collect();
            format!("{}({})", joined.name, places.join(" "))
        };
        let arrays: Vec<_> = join(&names).0.iter().map(array).collect();
        arrays.join(" ")
    }

    #[test]
    fn components_are_joined_by_their_names() {
        for (names, expected) in [
            ("y x ux uy", "Points(1 0) u(2 3)"),
            ("X Y disp_x disp_y", "X(0 1) disp(2 3)"),
            ("DISPLACEMENT_X DISPLACEMENT_Y", "DISPLACEMENT(0 1)"),
            ("u1 u2 U1 U2 U3", "u(0 1) U(2 3 4)"),
            ("u_1 u_2", "u(0 1)"),
            ("v:0 v:1", "v(0 1)"),
            ("coord_x coord_y coord_z", "Points(0 1 2)"),
            ("x0 y0 vx vy", "X(0 1) v(2 3)"),
            ("X Y u v", "X(0 1) u(2 3)"),
            ("X Y Z u v w", "X(0 1 2) u(3 4 5)"),
            ("X u v", "X(0) u(1) v(2)"),
            ("R Z t u1 u2", "X(0 1) t(2) u(3 4)"),
            ("R theta Z u1 u2 u3", "X(0 . 2) u(3 4 5)"),
            ("z r ur uz", "Points(1 0) ur(2) uz(3)"),
            ("R theta", "R(0) theta(1)"),
            ("F11 F12 F21 F22", "F(0 1 2 3)"),
            ("F_xx F_xy F_yx F_yy F_zz", "F(0 1 . 2 3 . . . 4)"),
            ("S11 S22 S12", "S(0 1 2)"),
            ("sigma_11 sigma_12 sigma_22", "sigma(0 2 1)"),
            ("s11 s22 s33 s12 s13 s23", "s(0 1 2 3 5 4)"),
            ("sigma_xx sigma_yy sigma_zz sigma_xy", "sigma(0 1 2 3 . .)"),
            ("stress_xx stress_yy stress_zz tau_xy tau_yz tau_xz", "stress(0 1 2 3 4 5)"),
            ("tau_xx tau_yy tau_xy", "tau(0 1 2)"),
            ("node_1 node_3", "node_1(0) node_3(1)"),
            ("S12 mass", "S12(0) mass(1)"),
            ("DispX DispY VelX VelY", "Disp(0 1) Vel(2 3)"),
            ("StressXX StressYY StressXY", "Stress(0 1 2)"),
            ("posX posY", "Points(0 1)"),
            ("displacement[0] displacement[1]", "displacement(0 1)"),
            ("sigma(xx) sigma(yy) sigma(xy)", "sigma(0 1 2)"),
            ("Index MaX", "Index(0) MaX(1)"),
        ] {
            assert_eq!(told(names), expected, "{names}");
        }
    }

    #[test]
    fn scalars_stay_apart_where_there_is_an_array_of_their_name() {
        let (joined, _) = join(&[("disp", 3), ("disp_x", 1), ("disp_y", 1)]);
        let names: Vec<_> = joined.iter().map(|joined| joined.name.as_str()).collect();
        assert_eq!(names, ["disp", "disp_x", "disp_y"]);
    }
}
