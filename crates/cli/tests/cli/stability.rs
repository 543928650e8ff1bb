//! `mms stability`, and studies that are kept, as a user meets them.

use crate::command::{UnderWay, keys, mms, names, read_json, refuses};
use serde_json::Value;
use std::path::Path;

#[test]
fn a_limit_is_bracketed_and_its_failure_told() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let called = mms(place, "stability axis-aligned --cells 8 --json limit.json");
    assert_eq!(called.status, 0, "{}", called.stderr);
    assert!(
        called.stdout.contains("A run is unstable if\n  a particle has J <= 0"),
        "{}",
        called.stdout
    );
    let found = read_json(&place.join("limit.json"));
    assert_eq!(keys(&found), "over rows schema search settings");
    assert_eq!(found["schema"], "mmsmith.stability/1");
    let row = &found["rows"][0];
    assert_eq!(
        keys(row),
        "at_limit bracket cfl_max failure p_wave_cfl p_wave_limit reference runs unstable_below"
    );
    assert_eq!(keys(&row["failure"]), "kind limit particle step time value");
    let number = |value: &Value| value.as_f64().expect("a number");
    let limit = number(&row["cfl_max"]);
    assert_eq!(limit, number(&row["bracket"][0]));
    assert!(number(&row["bracket"][1]) - limit <= 0.01, "{row}");
    assert!((0.6..1.0).contains(&limit), "{row}");
    assert!((number(&row["p_wave_cfl"]) * number(&row["p_wave_limit"]) - limit).abs() < 1e-12);

    let stable = format!("stability axis-aligned --cells 8 --at {limit}");
    assert_eq!(mms(place, &stable).status, 0);
    let unstable = format!("stability axis-aligned --cells 8 --at {}", row["bracket"][1]);
    let called = mms(place, &unstable);
    assert_eq!(called.status, 1, "{}", called.stdout);
    assert!(called.stdout.contains("UNSTABLE") && called.stdout.contains("step"));
}

const MAP: &str = "stability axis-aligned --cells 4 --over amplitude=1e-8,0.1 --over nu=0,0.4";

#[test]
fn a_map_is_the_same_for_any_number_of_threads_and_is_drawn() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let rows = ["1", "2"].map(|threads| {
        let call = format!("{MAP} --threads {threads} --json m.json --plot m.svg --csv m.csv");
        assert_eq!(mms(place, &call).status, 0);
        read_json(&place.join("m.json"))["rows"].clone()
    });
    assert_eq!(rows[0], rows[1]);
    let rows = rows[0].as_array().expect("rows");
    let pairs: Vec<_> = rows.iter().map(|row| (&row["amplitude"], &row["nu"])).collect();
    assert_eq!(pairs.len(), 4);
    assert_eq!((pairs[1].0.as_f64(), pairs[1].1.as_f64()), (Some(1e-8), Some(0.4)));
    let svg = std::fs::read_to_string(place.join("m.svg")).expect("a picture");
    assert_eq!(svg.matches("class=\"cell\"").count(), 4);
    let csv = std::fs::read_to_string(place.join("m.csv")).expect("a table");
    let widths: Vec<_> = csv.lines().map(|line| line.split(',').count()).collect();
    assert_eq!(widths.len(), 5);
    assert!(widths.iter().all(|width| *width == widths[0]), "{csv}");
}

#[test]
fn settings_words_and_units_can_be_varied() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let call = "stability axis-aligned --cells 4 --width 0.05 --over shape=ugimp,gimp \
                --over integrator=cd,usl --json m.json";
    let called = mms(place, call);
    assert_eq!(called.status, 0, "{}", called.stderr);
    let rows = read_json(&place.join("m.json"))["rows"].clone();
    assert_eq!((&rows[1]["shape"], &rows[1]["integrator"]), (&"ugimp".into(), &"usl".into()));
    // Units that differ by powers of two change no bit of a limit.
    let call =
        "stability bar --cells 6 --width 0.05 --over units=-7,0,20 --plot l.svg --json m.json";
    let called = mms(place, call);
    assert_eq!(called.status, 0, "{}", called.stderr);
    let rows = read_json(&place.join("m.json"))["rows"].clone();
    assert!(rows[0]["cfl_max"].is_number(), "{rows}");
    assert_eq!(rows[0]["bracket"], rows[1]["bracket"]);
    assert_eq!(rows[2]["bracket"], rows[1]["bracket"]);
    let svg = std::fs::read_to_string(place.join("l.svg")).expect("a picture");
    assert!(svg.contains("class=\"analytic\"") && svg.contains("class=\"measured\""));
}

#[test]
fn every_failure_of_a_random_search_can_be_repeated() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let search = "stability axis-aligned-1d --search random --samples 12 --seed 3";
    let called = mms(place, &format!("{search} --cfl 2.5 --json s.json"));
    assert_eq!(called.status, 1, "{}", called.stdout);
    let failures = read_json(&place.join("s.json"))["failures"].clone();
    let failures = failures.as_array().expect("failures");
    assert!(!failures.is_empty());
    for failure in &failures[..failures.len().min(3)] {
        let command = failure["command"].as_str().expect("a command");
        assert!(called.stdout.contains(command));
        let arguments = command.strip_prefix("mms ").expect("the program's name");
        let again = mms(place, &format!("{arguments} --json again.json"));
        assert_eq!(again.status, 1, "{command}: {}{}", again.stdout, again.stderr);
        let again = read_json(&place.join("again.json"));
        assert_eq!(again["result"]["failure"], failure["failure"], "{command}");
    }
    assert_eq!(mms(place, &format!("{search} --cfl 0.4")).status, 0);
}

#[test]
fn bad_settings_are_named() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let call = |options: &str| format!("stability axis-aligned --cells 4 {options}");
    refuses(place, &call("--over"), &["--over"]);
    refuses(place, &call("--over nu"), &["--over", "NAME=VALUE"]);
    refuses(place, &call("--over nu=0,x"), &["--over nu=x", "finite number"]);
    refuses(place, &call("--over nu=0.7"), &["nu=0.7", "must be"]);
    refuses(place, &call("--over shape=cubic"), &["cubic", "gimp"]);
    refuses(place, &call("--over mu=1"), &["no parameter 'mu'"]);
    refuses(place, &call("--over ppc=0"), &["ppc=0", "at least 1"]);
    refuses(place, &call("--over offset=0.7"), &["offset", "-0.5 to 0.5"]);
    refuses(place, &call("--over nu=0 --over nu=0.1"), &["given twice"]);
    refuses(place, &call("--over nu=0 --over ppc=2 --over cells=4"), &["two make a map", "3"]);
    refuses(place, &call("--lower 0.9 --upper 0.5"), &["--lower", "--upper"]);
    refuses(place, &call("--width 0"), &["--width", "positive"]);
    refuses(place, &call("--width 1e-16"), &["width = 1e-16", "at least 1e-15"]);
    refuses(place, &call("--width 1e-9 --precision f32"), &["width = 1e-9", "at least 1e-6"]);
    refuses(place, &call("--plot p.svg"), &["--over"]);
    refuses(place, &call("--samples 3"), &["--search"]);
    refuses(place, &call("--over units=x"), &["whole number"]);
    refuses(place, "run axis-aligned --offset 0.7", &["offset", "-0.5 to 0.5"]);
    std::fs::write(place.join("file"), "mine").expect("a file");
    refuses(place, &call("--out file"), &["--out", "file"]);
}

/// The study that is killed; long enough to be met at every stage.
const STUDY: &str = "stability axis-aligned --cells 4 --width 0.002 --over nu=-0.2,0,0.1,0.2,0.3,0.4 \
                     --over ppc=2,3 --out study --json table.json";

fn kept(place: &Path) -> Vec<String> {
    let text = std::fs::read_to_string(place.join("study/cases.jsonl")).unwrap_or_default();
    text.lines().filter(|line| line.ends_with('}')).map(str::to_owned).collect()
}

#[cfg(unix)]
#[test]
fn a_killed_study_goes_on_where_it_stopped_and_ends_with_the_same_table() {
    let [place, whole] = [(); 2].map(|()| tempfile::tempdir().expect("a folder"));
    let (place, whole) = (place.path(), whole.path());
    let reference = mms(whole, STUDY);
    assert_eq!(reference.status, 0, "{}", reference.stderr);

    // The table goes to a pipe that nobody reads, so that the study cannot end before it is killed.
    crate::command::pipe(&place.join("table.json"));
    let mut before = 0;
    for finished in [0, 1, 1, 4, 6, 7, 12] {
        let mut study = UnderWay::start(place, STUDY);
        let claims = place.join("study/claims");
        study.wait_for(|| claims.exists() && kept(place).len() >= finished);
        study.kill();
        let lines = kept(place);
        assert!(lines.len() >= before, "a finished case is lost");
        before = lines.len();
    }
    std::fs::remove_file(place.join("table.json")).expect("the pipe");
    let ended = mms(place, STUDY);
    assert_eq!(ended.stdout, reference.stdout);
    let rows = |place: &Path| read_json(&place.join("table.json"))["rows"].clone();
    assert_eq!(rows(place), rows(whole));
    let mut lines = kept(place);
    assert_eq!(lines.len(), 12, "each case once");
    lines.sort();
    let mut expected = kept(whole);
    expected.sort();
    assert_eq!(lines, expected);

    // A damaged line is named, set aside and computed anew.
    let file = place.join("study/cases.jsonl");
    let text = std::fs::read_to_string(&file).expect("cases");
    std::fs::write(&file, text.replacen("\"cfl_max\":0", "\"cfl_max\":1", 1)).expect("damage");
    let mended = mms(place, STUDY);
    assert_eq!(mended.stdout, reference.stdout);
    let said = &mended.stderr;
    assert!(said.contains("cases.jsonl, line ") && said.contains("checksum"), "{said}");
    assert_eq!(kept(place).len(), 12);
    assert_eq!(names(&place.join("study")), ["cases.jsonl", "claims", "damaged.jsonl", "lock"]);
    let again = mms(place, STUDY);
    assert_eq!((again.stdout, again.stderr.as_str()), (reference.stdout, ""));
}

#[test]
fn two_processes_share_a_study_and_agree() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let other = STUDY.replace("table.json", "other.json");
    let studies = [UnderWay::start(place, STUDY), UnderWay::start(place, &other)];
    for study in studies {
        assert_eq!(study.end(), 0);
    }
    assert_eq!(kept(place).len(), 12, "no case twice");
    let rows = |name: &str| read_json(&place.join(name))["rows"].clone();
    assert_eq!(rows("table.json"), rows("other.json"));
}

#[test]
fn a_study_of_convergence_is_kept_to_the_bit() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    // The last case is unstable: its row has a status to be kept, too, and the study fails.
    let call = "converge axis-aligned --cells 8 --cfls 0.2,0.4,2.0 --out study --json table.json";
    let first = mms(place, call);
    assert_eq!(first.status, 1, "{}", first.stderr);
    let table = read_json(&place.join("table.json"));
    assert_eq!(kept(place).len(), 4, "three rows, and the differences");
    let second = mms(place, call);
    assert_eq!(second.stdout, first.stdout);
    // Times included: nothing was computed again.
    assert_eq!(read_json(&place.join("table.json")), table);
    assert!(table["rows"][0].get("timed_alone").is_none());
    // Another parameter is another study.
    assert_eq!(mms(place, &format!("{call} --set A=0.05")).status, 1);
    assert_eq!(kept(place).len(), 8);
}

#[test]
fn growth_of_the_exact_motion_is_told_as_a_table_and_as_json() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let call = "stability swirl --exact --cells 6 --periods 0.25 --set A=0.1 --over nu=0.3,0.4999 --json g.json --csv g.csv";
    let called = mms(place, call);
    assert_eq!(called.status, 0, "{}", called.stderr);
    let found = read_json(&place.join("g.json"));
    assert_eq!(keys(&found), "over rows schema settings");
    assert_eq!(found["schema"], "mmsmith.growth/1");
    let factor = |row: usize| found["rows"][row]["factor"].as_f64().expect("a factor");
    assert!(factor(0) < 2.0 && factor(1) > 10.0, "{} {}", factor(0), factor(1));
    assert_eq!(found["rows"][1]["nu"], 0.4999);
    assert!(found["rows"][1]["extremes"]["pressure_over_mu"].as_f64().expect("p") > 20.0);
    // A row for each of three waves and for the worst, and the header.
    let csv = std::fs::read_to_string(place.join("g.csv")).expect("a table");
    assert_eq!(csv.lines().count(), 9, "{csv}");

    // Splines at loaded sides have faster waves than those at held ones, and steps follow them.
    let call = "stability shears-loaded --exact --cells 6 --periods 0.1 --json g.json";
    let called = mms(place, call);
    assert!(called.stdout.contains("The motion is stable"), "{}", called.stdout);

    refuses(place, "stability swirl --exact --at 0.5", &["--exact", "--at"]);
    refuses(place, "stability swirl --exact --over shape=gimp", &["the exact motion has no shape"]);
    refuses(place, "stability swirl --exact --shape gimp", &["bspline2 to bspline5"]);
    refuses(place, "stability block-j2 --exact", &["on its history"]);
}

/// A small pressure is no stability where plane waves have no stiffness left.
#[test]
fn motions_in_which_waves_lose_their_stiffness_are_not_called_stable() {
    let place = tempfile::tempdir().unwrap();
    let place = place.path();
    for name in ["pressed-beyond-its-limit", "prestress-of-pressure"] {
        let file = Path::new(env!("CARGO_MANIFEST_DIR"))
            .join(format!("../../tests/data/specs/told/{name}.toml"));
        let file = file.display();
        for command in ["check", "explain"] {
            let called = mms(place, &format!("{command} {file}"));
            assert!(called.stdout.contains("the exact motion is UNSTABLE"), "{}", called.stdout);
            assert!(called.stdout.contains("waves lose their stiffness"), "{}", called.stdout);
        }
        let measured = mms(place, &format!("stability {file} --exact --json growth.json"));
        let growth = read_json(&place.join("growth.json"))["rows"][0].clone();
        assert!(growth["factor"].as_f64().unwrap() > 10.0, "{}", measured.stdout);
        assert!(growth["extremes"]["wave_stiffness"].as_f64().unwrap() <= 0.0, "{growth}");
        let run = mms(place, &format!("run {file} --cells 8 --formulation total-lagrangian"));
        assert!(run.stdout.contains("warning: errors grow"), "{}", run.stdout);
    }
}

#[test]
fn commands_warn_of_motions_that_are_unstable_and_of_none_that_are_not() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let of = |nu: &str, amplitude: &str| {
        let call = format!(
            "run swirl --cells 8 --periods 0.25 --set nu={nu} --set A={amplitude} --json r.json"
        );
        let called = mms(place, &call);
        (called.stdout, read_json(&place.join("r.json")))
    };
    let (told, found) = of("0.4999", "0.1");
    assert!(told.contains("errors grow") && told.contains("--set A="), "{told}");
    assert!(told.contains("lambda/mu is 5000"), "{told}");
    assert!(found["growth"]["factor"].as_f64().expect("a factor") > 100.0);
    // Three times is less than a digit.
    let (told, found) = of("0.4999", "0.02");
    assert!(!told.contains("errors grow") && found["growth"].is_null(), "{told}");
    let (told, found) = of("0.3", "0.1");
    assert!(!told.contains("warning") && found["growth"].is_null(), "{told}");
    assert!(found["locking"].is_null());

    let call = "converge swirl --cells 4,8,12 --periods 0.25 --set nu=0.4999 --set A=0.1 --formulation total-lagrangian \
                --shape bspline3 --json c.json";
    let called = mms(place, call);
    let found = read_json(&place.join("c.json"));
    let reason = found["not_judged"].as_str().expect("a reason");
    assert!(reason.contains("errors grow"), "{reason}");
    // Errors above the motion fail all the same.
    assert!(called.stdout.contains("error exceeds the motion"), "{}", called.stdout);
    assert_eq!(called.status, 1);
}

/// A square of a motion, with the same condition on all sides.
fn square(place: &Path, name: &str, displacement: &str, condition: &str, units: &str) {
    let side =
        |name: &str| format!("[[boundary]]\nsurface = '{name}'\ncondition = '{condition}'\n");
    let sides: String = ["X-lower", "X-upper", "Y-lower", "Y-upper"].map(side).concat();
    let text = format!(
        "name = '{name}'\ntitle = '{name}'\ncoordinates = 'cartesian'\ndimension = 2\n[parameters]\nA = {{ default = 0.1{units} }}\n\
         E = {{ default = 1000 }}\nnu = {{ default = 0.3 }}\nrho0 = {{ default = 2 }}\n[let]\nc = 'sqrt(E/rho0)'\n[displacement]\n\
         {displacement}\n[material]\nlaw = 'neo-hookean'\n[domain]\nshape = 'box'\nlower = [0, 0]\nupper = [1, 1]\n{sides}\
         [time]\nperiod = '2/c'\n"
    );
    std::fs::write(place.join(format!("{name}.toml")), text).expect("a specification");
}

/// Where the grid contains the motion, errors are those of the steps alone, and grow by far more than ten below the limit.
#[test]
fn accuracy_lost_in_time_is_no_instability() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let affine = "X = 'A*X*cos(c*t)'\nY = '-A*Y*cos(c*t)'";
    square(place, "affine", affine, "prescribed-motion", "");
    let rigid = "X = 'A*cos(c*t)'\nY = 'A*sin(c*t)'";
    square(place, "rigid", rigid, "traction-free", "");
    // Beside the limit that runs without a criterion of the error have, which end inside out from there on.
    for (name, least) in [("affine", 0.4), ("rigid", 0.24)] {
        let call = format!(
            "stability {name}.toml --cells 4 --periods 0.5 --formulation total-lagrangian --width 0.05 --json l.json"
        );
        let called = mms(place, &call);
        assert_eq!(called.status, 0, "{}", called.stderr);
        let row = read_json(&place.join("l.json"))["rows"][0].clone();
        let number = |value: &Value| value.as_f64().expect("a number");
        assert!(number(&row["cfl_max"]) > least, "{name}: {row}");
        let times = number(&row["at_limit"]["error"]) / number(&row["reference"]["error"]);
        assert!(times > 10.0, "{name}: {times}");
    }
}

#[test]
fn without_a_strain_energy_there_is_no_drift_and_that_is_said() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let call = "stability bar-j2 --cells 4 --periods 0.1 --width 0.2 --json m.json";
    let called = mms(place, call);
    assert_eq!(called.status, 0, "{}", called.stderr);
    let row = read_json(&place.join("m.json"))["rows"][0].clone();
    assert!(
        row["at_limit"]["energy_drift"].is_null() && row["reference"]["energy_drift"].is_null(),
        "{row}"
    );
    assert!(called.stdout.contains("The law has no strain energy"), "{}", called.stdout);
    let called = mms(place, "stability bar-j2 --cells 4 --periods 0.1 --at 0.2");
    assert!(called.stdout.contains("The law has no strain energy"), "{}", called.stdout);

    // A law of space has one in the half plane, too.
    let half = "thick-cylinder --cells 4 --periods 0.1 --formulation updated-lagrangian --shape cpdi2 --layout clipped";
    let called = mms(place, &format!("stability {half} --width 0.3 --json m.json"));
    let row = read_json(&place.join("m.json"))["rows"][0].clone();
    assert!(row["reference"]["energy_drift"].as_f64().is_some_and(|drift| drift > 0.0), "{row}");
    assert!(!called.stdout.contains("no strain energy"), "{}", called.stdout);
}

#[test]
fn units_are_varied_where_parameters_have_them_and_refused_by_name_elsewhere() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let motion = "X = 'A*sin(Pi*X)*sin(c*t)'\nY = '0'";
    square(place, "bare", motion, "prescribed-motion", ", unit = 'm'");
    let call = "stability bare.toml --cells 4 --width 0.2 --over units=0,3";
    refuses(place, call, &["units=3", "E, nu, rho0", "E = { default = 1000.0, unit = 'Pa' }"]);
    let file = place.join("bare.toml");
    let text = std::fs::read_to_string(&file).expect("a specification");
    let text = text.replace("default = 1000 ", "default = 1000, unit = 'Pa' ");
    std::fs::write(&file, text.replace("default = 2 ", "default = 2, unit = 'kg/m^3' "))
        .expect("a file");
    let called = mms(place, &format!("{call} --json m.json"));
    assert_eq!(called.status, 0, "{}", called.stderr);
    let rows = read_json(&place.join("m.json"))["rows"].clone();
    assert_eq!(rows[0]["bracket"], rows[1]["bracket"]);
}

#[test]
fn options_without_an_effect_are_refused() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    refuses(place, "stability bar --cells 4 --cfl 0.2", &["--cfl 0.2", "--at 0.2", "--lower"]);
    refuses(place, "stability bar --cells 4 --at 0.3 --cfl 0.2", &["--cfl 0.2"]);
    for option in ["--cfl 0.2", "--layout gauss", "--ppc 3", "--precision f32", "--energy-rate 2"] {
        let name = option.split(' ').next().unwrap_or_default();
        let call = format!("stability swirl --exact --cells 4 {option}");
        refuses(place, &call, &[&format!("--exact {name}"), "leave"]);
    }
    refuses(place, "run bar --static --cells 4 --vtk v --frames 3", &["--frames"]);
    refuses(place, "run bar --static --cells 4 --profile", &["--profile"]);
}

/// Both formulations tell of the whole body, in columns of the same names.
#[test]
fn a_body_of_revolution_has_one_energy_in_both_formulations() {
    let place = tempfile::tempdir().expect("a folder");
    let place = place.path();
    let of = |scheme: &str| {
        let call = format!(
            "run thick-cylinder --cells 8 --periods 0.2 {scheme} --history h.csv --json r.json"
        );
        let called = mms(place, &call);
        assert_eq!(called.status, 0, "{}", called.stderr);
        let text = std::fs::read_to_string(place.join("h.csv")).expect("a history");
        let header = text.lines().nth(1).expect("a header").to_owned();
        let history = read_json(&place.join("r.json"))["history"].clone();
        let last = |name: &str| {
            history[name].as_array().and_then(|all| all.last().cloned()).expect("a list")
        };
        let number = |value: &Value| value.as_f64().expect("a number");
        let start = number(&history["strain_energy"][0]);
        (header, start, number(&last("kinetic_energy")), number(&last("momentum")[2]))
    };
    let updated = of("--formulation updated-lagrangian --shape cpdi2 --layout clipped --cfl 0.05");
    let total = of("--formulation total-lagrangian --shape bspline3 --cfl 0.1");
    assert_eq!(updated.0, total.0);
    assert!(updated.0.contains(",momentum_R,momentum_theta,momentum_Z,"), "{}", updated.0);
    for (one, other) in [(updated.1, total.1), (updated.2, total.2), (updated.3, total.3)] {
        assert!((one - other).abs() < 0.05 * other.abs(), "{updated:?} {total:?}");
    }
    // A law with memory has no strain energy.
    let called = mms(place, "run bar-j2 --cells 4 --periods 0.05 --history h.csv");
    assert!(called.stdout.contains("no strain energy"), "{}", called.stdout);
}
