//! As fields.cc, for a module in Rust: u, v, a, H, F, J, P and b of each point, and the internal variables where there are some.

mod solution;

use mmsmith_runtime::{Real, Solution, nalgebra::SVector};
use std::io::{Read, Write};

const D: usize = DIMENSION;

fn main() {
    let own = solution::SOLUTION::<f64>::from_values(&[]).unwrap();
    //TABLE let own = own.with_table("TABLE_FILE").unwrap();
    //TABLE assert!(own.with_table("Cargo.toml").is_err());
    let mut bytes = Vec::new();
    std::io::stdin().read_to_end(&mut bytes).unwrap();
    let numbers: Vec<f64> = bytes.chunks(8).map(|b| f64::from_le_bytes(b.try_into().unwrap())).collect();
    let mut out = Vec::new();
    for point in numbers[1..].chunks(D + 1) {
        let (X, t) = (SVector::<f64, D>::from_column_slice(&point[..D]), point[D]);
        let all = own.fields(&X, t);
        let mut staged = [SVector::zeros()];
        own.body_force_at(&[X]).evaluate(t, 0, &mut staged);
        assert!((staged[0] - all.b).norm() <= 1e-12 * (1e4 + all.b.norm()));
        let rows = |A: nalgebra_matrix::Matrix| A.transpose().iter().copied().collect::<Vec<f64>>();
        out.extend([all.u, all.v, all.a].iter().flat_map(|v| v.iter().copied()));
        out.extend(rows(all.H).into_iter().chain(rows(all.F)).chain([all.J]).chain(rows(all.P)));
        out.extend(all.b.iter().copied().chain(own.internal(&X, t)));
        let density: f64 = own.density_at(&X).to_f64();
        out.extend(all.b.iter().map(|b| density * b));
    }
    //TABLE assert!(own.body_force(&SVector::from_column_slice(&numbers[1..=D]), 1e9).iter().all(|b| b.is_nan()));
    let bytes: Vec<u8> = out.iter().flat_map(|x| x.to_le_bytes()).collect();
    std::io::stdout().write_all(&bytes).unwrap();
}

mod nalgebra_matrix {
    pub(crate) type Matrix = mmsmith_runtime::nalgebra::SMatrix<f64, { super::D }, { super::D }>;
}
