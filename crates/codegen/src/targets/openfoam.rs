//! Fragments for OpenFOAM and solids4foam, which include the C header.

use crate::code::Code;
use crate::listing::commented;
use crate::names::Names;
use crate::target::Unwritable;

const REMARKS: &str = "\
Fragments of a case for OpenFOAM and solids4foam. Write the C header beside them, mms gen NAME --target c --out DIR, and put DIR into codeOptions below. \
OpenFOAM.com: the first block goes into constant/fvOptions. OpenFOAM.org: the same code goes into constant/fvModels with `type coded;`. The second block is \
for a patch of 0/D, or pointD in solids4foam.
mesh.C() and patch().Cf() are the REFERENCE position in total Lagrangian solvers, whose mesh does not move; elsewhere put the undeformed positions in.
The sign: fvOptions adds its source to the right-hand side, as eqn -= source on the matrix of the left-hand side, weighted with cell volumes; a solver whose \
matrix has the other sign needs the other sign here. Run once with gravity alone and look which way the body falls.
The source is rho0_b, a force per reference volume, for equations that have rho d2D/dt2; for equations divided by the density set perMass to true.";

const PREPARED: &str = "        const MODULE_parameters parameters = MODULE_defaults();
        MODULE_solution solution;
        if (const char* message = MODULE_prepare(&solution, &parameters))
        {
            FatalErrorInFunction << message << exit(FatalError);
        }
";

/// The table, which lies beside the header, is read once.
const WITH_TABLE: &str = "        static MODULE_solution solution;
        static bool isReady = false;
        if (!isReady)
        {
            const MODULE_parameters parameters = MODULE_defaults();
            const char* folder = getenv(\"FOAM_CASE\");
            const std::string table = std::string(folder ? folder : \".\") + \"/mms/TABLE_FILE\";
            const char* message = MODULE_prepare(&solution, &parameters);
            message = message ? message : MODULE_read_table(&solution, table.c_str());
            if (message)
            {
                FatalErrorInFunction << message << exit(FatalError);
            }
            isReady = true;
        }
";

pub(crate) fn source(code: &Code<'_>) -> Result<String, Unwritable> {
    let module = Names::of(&code.spec.name).module;
    let remarks = REMARKS.replace("NAME", &code.spec.name);
    let head = commented(&code.head_for_host(&remarks), "//", 118);
    let density = match code.has_graded_density() {
        true => "MODULE_rho0(&solution, X)",
        false => "MODULE_density(&solution)",
    };
    let prepared = if code.table.is_some() { WITH_TABLE } else { PREPARED };
    let fragments = include_str!("openfoam.template")
        .replace("        PREPARED\n", prepared)
        .replace("DENSITY", density)
        .replace("TABLE_FILE", &code.table_file())
        .replace("MODULE", &module)
        .replace("DIMENSION", &code.spec.dimension.to_string());
    Ok(head + &fragments)
}
