//! Vectors and matrices of expressions.

use crate::coordinates::identity;
use mmsmith_expr::{Expr, Graph};

pub(crate) type Vector = Vec<Expr>;
pub(crate) type Matrix = Vec<Vec<Expr>>;

pub(crate) fn transpose(A: &Matrix) -> Matrix {
    (0..A.len()).map(|i| A.iter().map(|row| row[i]).collect()).collect()
}

pub(crate) fn matrix_product(graph: &mut Graph, A: &Matrix, B: &Matrix) -> Matrix {
    let n = A.len();
    let mut product = identity(n);
    for i in 0..n {
        for j in 0..n {
            let terms: Vec<Expr> = (0..n).map(|m| graph.mul(A[i][m], B[m][j])).collect();
            product[i][j] = graph.sum_of(terms);
        }
    }
    product
}

/// The determinant, by expansion along a row or a column with one entry where there is one, so that it is a product then; else along the
/// first row.
pub(crate) fn determinant(graph: &mut Graph, A: &Matrix) -> Expr {
    if A.is_empty() {
        return Graph::ONE;
    }
    let along = lone_entry(A).or_else(|| lone_entry(&transpose(A)).map(|[j, i]| [i, j]));
    if let Some([i, j]) = along {
        let cofactor = cofactor(graph, A, i, j);
        return graph.mul(A[i][j], cofactor);
    }
    let mut terms = Vec::new();
    for j in 0..A.len() {
        let cofactor = cofactor(graph, A, 0, j);
        terms.push(graph.mul(A[0][j], cofactor));
    }
    graph.sum_of(terms)
}

/// Row and column of an entry that is the only one in its row.
fn lone_entry(A: &Matrix) -> Option<[usize; 2]> {
    A.iter().enumerate().find_map(|(i, row)| {
        let mut entries = row.iter().enumerate().filter(|(_, entry)| **entry != Graph::ZERO);
        let (j, _) = entries.next()?;
        entries.next().is_none().then_some([i, j])
    })
}

/// The cofactor of entry `(i, j)`.
pub(crate) fn cofactor(graph: &mut Graph, A: &Matrix, i: usize, j: usize) -> Expr {
    let without = |skipped: usize| (0..A.len()).filter(move |&k| k != skipped);
    let minor: Matrix = without(i).map(|k| without(j).map(|l| A[k][l]).collect()).collect();
    let determinant = determinant(graph, &minor);
    if (i + j).is_multiple_of(2) { determinant } else { graph.neg(determinant) }
}

/// The determinants of all principal submatrices but the empty one; they add up to `det(I + A) - 1`.
pub(crate) fn principal_minors(graph: &mut Graph, A: &Matrix) -> Vec<Expr> {
    minors_of_size(graph, A, 1)
}

/// The determinants of the principal submatrices of at least two rows.
pub(crate) fn minors_beyond_trace(graph: &mut Graph, A: &Matrix) -> Vec<Expr> {
    minors_of_size(graph, A, 2)
}

fn minors_of_size(graph: &mut Graph, A: &Matrix, least: usize) -> Vec<Expr> {
    index_sets(A.len())
        .filter(|indices| indices.len() >= least)
        .map(|indices| {
            let minor =
                indices.iter().map(|&i| indices.iter().map(|&j| A[i][j]).collect()).collect();
            determinant(graph, &minor)
        })
        .collect()
}

/// The sets of indices below `n`, but for the empty one.
pub(crate) fn index_sets(n: usize) -> impl Iterator<Item = Vec<usize>> {
    (1..1_usize << n).map(move |set| (0..n).filter(|i| set >> i & 1 == 1).collect())
}
