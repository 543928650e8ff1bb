//! The updated frame: CPDI, CPDI2 on fitted particles, splines, transfers and USAVG, through `mms`.
//!
//! These simulate for seconds and run in release mode, as those in `orders.rs`.

#![allow(clippy::unwrap_used)]

use mmsmith_tests::{at, column, json};

fn converge(call: &str) -> serde_json::Value {
    let words: Vec<_> = ["converge"].into_iter().chain(call.split_whitespace()).collect();
    json(&words)
}

/// Local orders of the largest error of a field.
fn local_orders(study: &serde_json::Value, field: &str) -> Vec<f64> {
    let orders = study["orders"][field]["linf"]["local"].as_array().unwrap();
    orders.iter().map(|order| order.as_f64().unwrap()).collect()
}

/// Against the figures of an independent implementation, L_inf of u over the amplitude; 256 cells reach 1.0e-4, where it
/// has 1.15e-4, but take half a minute.
#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn fitted_quadrilaterals_are_of_second_order_with_free_surfaces() {
    let study = converge(
        "ring --shape cpdi2 --layout body-fitted --cfl-speed p-wave --set Ri=0.4 --set Ro=0.6 --cells 32,64,128",
    );
    let errors = column(&study, &["errors", "u", "linf"]);
    for (error, reference) in errors.iter().zip([8.0e-3, 1.9e-3, 4.6e-4]) {
        assert!(error / 0.1 <= 2.0 * reference, "{error:e} {reference:e}");
    }
    for order in local_orders(&study, "u") {
        assert!((order - 2.0).abs() <= 0.1, "{order}");
    }
}

/// The order of each scheme, and its error as measured when this was written.
#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn every_scheme_has_its_order() {
    for (call, order, finest) in [
        ("axis-aligned --shape cpdi --cells 16,32", 2.0, 1.08e-3),
        ("axis-aligned --shape cpdi2 --cells 16,32", 2.0, 1.08e-3),
        ("axis-aligned-1d --shape cpdi2 --cells 16,32", 2.0, 7.5e-4),
        ("axis-aligned-3d --shape cpdi --cells 8,16", 1.92, 5.9e-3),
        // Where particles cross few knots: else their sums, which are no integrals, spoil the order of splines.
        ("axis-aligned --shape bspline2 --set A=0.01 --cells 16,32", 2.0, 1.36e-4),
        ("axis-aligned --shape bspline3 --set A=0.01 --cells 16,32", 2.0, 1.76e-4),
        ("axis-aligned --shape gimp-bspline2 --cells 16,32", 2.0, 1.48e-3),
        ("axis-aligned --shape gimp --transfer xpic2 --cells 16,32", 2.0, 1.01e-3),
        ("axis-aligned --shape gimp --transfer apic --cells 16,32", 2.0, 4.8e-4),
        ("axis-aligned --shape gimp --transfer pic --cells 16,32", 0.9, 1.12e-2),
        ("axis-aligned --shape gimp --integrator usavg --cells 16,32", 0.9, 3.7e-3),
        ("ring --shape cpdi --layout body-fitted --cells 16,32", 2.05, 2.4e-4),
        ("ring --shape cpdi2 --layout body-fitted --transfer xpic2 --cells 16,32", 2.04, 2.6e-4),
        ("ring --shape cpdi2 --layout body-fitted --extent full --cells 16,32", 2.06, 2.6e-4),
    ] {
        let study = converge(call);
        let found = local_orders(&study, "u")[0];
        assert!((found - order).abs() <= 0.1, "{call}: {found}");
        let error = column(&study, &["errors", "u", "linf"])[1];
        assert!((error / finest - 1.0).abs() < 0.05, "{call}: {error:e}");
    }
}

/// Where quadratic splines at the particles' points have errors that grow, their means over the particles' boxes have order 2 in every field, with
/// every transfer that keeps it, for a whole period and in shear.
#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn means_of_splines_are_of_second_order_in_every_field_on_moving_particles() {
    for (call, u, P) in [
        ("axis-aligned --cells 16,32,64 --transfer apic", 1.95, 1.9),
        ("axis-aligned --cells 16,32,64 --transfer flip", 1.95, 1.9),
        ("axis-aligned-1d --cells 64,128,256 --transfer apic", 1.95, 1.85),
        ("axis-aligned --cells 32,64,128 --periods 0.1 --transfer apic", 1.95, 1.4),
        ("swirl --cells 16,32,64 --periods 0.25 --transfer apic", 1.75, 1.85),
        (
            "swirl --set A=0.01 --set nu=0.4999 --cells 16,32,64 --periods 0.05 --volume projected",
            1.9,
            2.0,
        ),
    ] {
        let study = converge(&format!("{call} --shape gimp-bspline2"));
        for (field, least) in [("u", u), ("P", P)] {
            let orders = study["orders"][field]["l2"]["local"].as_array().unwrap();
            let all = orders.iter().all(|order| order.as_f64().unwrap() > least);
            assert!(all, "{call} {field}: {orders:?}");
        }
    }
}

/// Where two particles a direction turn inside out, or have errors of P that grow, four with splines at their corners have order 2 and more.
#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn short_polygons_follow_a_vortex_that_shears_by_seven() {
    let scheme = "--layout clipped --shape bspline2 --transfer apic --ppc 4 --cfl 0.1";
    let study = converge(&format!("vortex {scheme} --cells 24,48 --periods 0.25"));
    for field in ["u", "P"] {
        let order = at(&study, &["orders", field, "l2", "fit"]);
        assert!(order > 1.9, "{field}: {order}");
    }
}

/// Without stress between rim and grid: the quarter between planes of symmetry is the whole ring. Light nodes of a clipped one are
/// extended across the planes.
#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn a_quarter_of_the_ring_moves_as_the_whole_does() {
    for scheme in ["--shape cpdi2 --layout body-fitted", "--layout clipped"] {
        let error = |extent: &str| {
            let call = format!("run ring {scheme} --cells 16 --extent {extent}");
            at(&json(&call.split(' ').collect::<Vec<_>>()), &["result", "errors", "F", "l2"])
        };
        let (quarter, full) = (error("quarter"), error("full"));
        assert!((quarter / full - 1.0).abs() < 1e-9, "{scheme}: {quarter:e} {full:e}");
    }
}

/// The largest error of F lies at the rims, where it has the order of linear functions. Where light nodes were not extended it depended on
/// how each grid cuts a rim: these had orders from -0.44 to 2.27, from 0.34 to 0.89 and from 0.61 to 0.88.
#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn deformation_gradients_at_clipped_rims_are_of_first_order_wherever_the_grid_cuts() {
    for call in [
        "ring --layout clipped --cells 72,80,90,100,112",
        "ring-nu --layout clipped --cells 32,64,128",
        "ring --layout clipped --periods 10 --cells 16,32,64",
    ] {
        let study = converge(call);
        let orders = local_orders(&study, "F");
        assert!(orders.iter().all(|order| (0.8..1.2).contains(order)), "{call}: {orders:?}");
        let fit = at(&study, &["orders", "F", "l2", "fit"]);
        assert!(fit > 1.4, "{call}: {fit}");
    }
}

/// Errors in units of the amplitude on the finest grid, L_inf and L2 of u; both fall with order 2, wherever the grid lies.
#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn clipped_lattices_are_of_second_order_with_free_and_loaded_surfaces() {
    for (call, linf, l2) in [
        ("ring --layout clipped --cells 32,64,128", 1.78e-4, 1.46e-4),
        ("ring --layout clipped --precision f32 --cells 16,32,64", 7.1e-4, 5.9e-4),
        ("ring --layout clipped --offset 0.37 --set A=0.05 --cells 16,32,64", 6.7e-4, 5.1e-4),
        (
            "ring --layout clipped --ppc 3 --set Ri=0.53 --set Ro=0.97 --cells 16,32,64",
            6.4e-4,
            5.0e-4,
        ),
        ("ring --grid-angle 17 --grid-shift 0.31 --cells 16,32,64", 6.9e-4, 5.9e-4),
        ("ring-nu --layout clipped --cells 16,32,64", 8.8e-4, 7.3e-4),
        ("skew-2d --layout clipped --cells 16,32,64", 4.7e-3, 1.55e-3),
        ("skew-2d --grid-angle 30 --grid-shift 0.37 --cells 16,32,64", 4.5e-3, 1.55e-3),
        ("axis-aligned --grid-angle 30 --grid-shift 0.2 --cells 16,32,64", 4.4e-3, 1.73e-3),
    ] {
        let study = converge(call);
        let amplitude = at(&study, &["settings", "parameters", "A"]);
        for (norm, bound, least) in [("linf", linf, 1.85), ("l2", l2, 1.95)] {
            let finest = column(&study, &["errors", "u", norm])[2] / amplitude;
            assert!(finest < bound, "{call}: {norm} {finest:e}");
            assert!(finest > 0.8 * bound, "{call}: {norm} {finest:e}");
            let fit = at(&study, &["orders", "u", norm, "fit"]);
            assert!((least..2.2).contains(&fit), "{call}: {norm} {fit}");
        }
    }
}

#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn results_are_the_same_bits_for_any_number_of_threads() {
    for scheme in [
        "--shape cpdi2 --layout body-fitted",
        "--layout clipped --grid-angle 20",
        "--shape bspline3 --transfer apic",
    ] {
        let errors = |threads: &str| {
            let call = format!("run ring --cells 16 {scheme} --threads {threads}");
            json(&call.split(' ').collect::<Vec<_>>())["result"]["errors"].clone()
        };
        assert_eq!(errors("1"), errors("2"));
    }
}

/// Clipped lattices in space, on grids so coarse that the order is still on its way: with one finer it is 1.91 and 2.08.
#[test]
#[cfg_attr(debug_assertions, ignore = "simulates for long; runs in release mode")]
fn clipped_lattices_in_space_come_near_second_order_with_free_and_loaded_surfaces() {
    for (call, l2) in [
        ("axis-aligned-3d --layout clipped --grid-shift 0.37 --cells 8,16", 4.0e-2),
        ("axis-aligned-3d --grid-angle 25 --grid-shift 0.2 --cells 8,16", 4.0e-2),
        ("sphere-shell --layout clipped --cells 12,24", 3.5e-3),
    ] {
        let study = converge(&format!("{call} --tolerance 0.5"));
        let amplitude = at(&study, &["settings", "parameters", "A"]);
        let finest = column(&study, &["errors", "u", "l2"])[1] / amplitude;
        assert!(finest < l2 && finest > 0.7 * l2, "{call}: {finest:e}");
        let order = at(&study, &["orders", "u", "l2", "fit"]);
        assert!((1.75..2.45).contains(&order), "{call}: {order}");
    }
}
