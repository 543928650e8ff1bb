//! The hosts that files are written for: a row each.

mod abaqus;
mod c;
mod calculix;
mod cpp;
mod febio;
mod fortran;
mod jax;
mod julia;
mod kratos;
mod moose;
mod numpy;
mod openfoam;
mod python;
mod strings;
mod tables;
mod ufl;

use crate::target::Host;

impl Host {
    /// The host that `--target` calls `name`.
    #[must_use]
    pub fn named(name: &str) -> Option<&'static Host> {
        HOSTS.iter().find(|host| host.name == name)
    }
}

/// Every host, in the order in which help lists them.
pub const HOSTS: &[Host] = &[
    Host {
        name: "rust",
        about: "a module for a crate that depends on mmsmith-runtime",
        ending: ".rs",
        in_half_plane: false,
        reads_tables: true,
        write: |code| Ok(code.standalone_source()),
    },
    Host {
        name: "c",
        about: "a C99 header, for C, C++ and CUDA",
        ending: ".h",
        in_half_plane: true,
        reads_tables: true,
        write: |code| Ok(code.header_source()),
    },
    Host {
        name: "cpp",
        about: "a C++17 header for any scalar type, for MFEM, deal.II, smith, PETSc, GEOS",
        ending: ".hpp",
        in_half_plane: true,
        reads_tables: true,
        write: cpp::source,
    },
    Host {
        name: "fortran",
        about: "a Fortran 2008 module",
        ending: ".f90",
        in_half_plane: true,
        reads_tables: true,
        write: fortran::source,
    },
    Host {
        name: "abaqus",
        about: "user subroutines DLOAD, VDLOAD and UTRACLOAD, which find X from current coordinates",
        ending: "_abaqus.f90",
        in_half_plane: false,
        reads_tables: true,
        write: abaqus::source,
    },
    Host {
        name: "calculix",
        about: "the user subroutine dload of CalculiX",
        ending: "_calculix.f90",
        in_half_plane: false,
        reads_tables: true,
        write: calculix::source,
    },
    Host {
        name: "numpy",
        about: "a Python module for NumPy arrays, for scikit-fem, dolfinx, NGSolve",
        ending: "_numpy.py",
        in_half_plane: true,
        reads_tables: true,
        write: numpy::source,
    },
    Host {
        name: "jax",
        about: "a Python module for JAX, which differentiates it",
        ending: "_jax.py",
        in_half_plane: true,
        reads_tables: true,
        write: jax::source,
    },
    Host {
        name: "ufl",
        about: "a Python module of UFL expressions, for FEniCSx and Firedrake",
        ending: "_ufl.py",
        in_half_plane: true,
        reads_tables: false,
        write: ufl::source,
    },
    Host {
        name: "julia",
        about: "a Julia module, for Gridap, Ferrite, Trixi",
        ending: ".jl",
        in_half_plane: true,
        reads_tables: true,
        write: julia::source,
    },
    Host {
        name: "moose",
        about: "MOOSE input blocks",
        ending: ".i",
        in_half_plane: true,
        reads_tables: false,
        write: moose::source,
    },
    Host {
        name: "openfoam",
        about: "OpenFOAM and solids4foam: coded source and boundary fragments that include the C header",
        ending: "_openfoam",
        in_half_plane: false,
        reads_tables: true,
        write: openfoam::source,
    },
    Host {
        name: "kratos",
        about: "expressions of x, y, z and t for Kratos, as JSON",
        ending: "_kratos.json",
        in_half_plane: false,
        reads_tables: false,
        write: kratos::source,
    },
    Host {
        name: "febio",
        about: "expressions for FEBio, as XML",
        ending: "_febio.xml",
        in_half_plane: false,
        reads_tables: false,
        write: febio::source,
    },
];
