//! `cargo xtask release`: the command, its manual pages and its completions as one archive, whose program needs nothing of the system.

use anyhow::{Context, bail};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};
use std::process::Command;

/// With the C library of this target programs are static: they run on every Linux of this processor.
const TARGET: &str = "x86_64-unknown-linux-musl";
/// Files of the repository that whoever unpacks the archive needs.
const TEXTS: [&str; 4] = ["README.md", "CHANGELOG.md", "LICENSE-MIT", "LICENSE-APACHE"];
/// Shells, and the names under which they look for completions.
const COMPLETIONS: [(&str, &str); 5] = [
    ("bash", "mms.bash"),
    ("zsh", "_mms"),
    ("fish", "mms.fish"),
    ("elvish", "mms.elv"),
    ("powershell", "_mms.ps1"),
];

/// Builds the command and packs the archive into `out`, with its checksum beside it.
///
/// The same sources give the same bytes: `SOURCE_DATE_EPOCH`, or else the time of the commit, is the time of all files.
pub(crate) fn run(repository: &Path, out: &Path, allow_dirty: bool) -> anyhow::Result<Vec<String>> {
    let mms = compile(repository)?;
    let version = answer(Command::new(&mms).arg("--version"))?;
    if version.contains("with changes") && !allow_dirty {
        bail!("{version}: a release is a commit; commit the changes, or say --allow-dirty");
    }
    let name = name();
    let folder = out.join(&name);
    if folder.exists() {
        std::fs::remove_dir_all(&folder)
            .with_context(|| format!("cannot remove {}", folder.display()))?;
    }
    fill(repository, &mms, &folder)?;
    let archive = out.join(format!("{name}.tar.gz"));
    pack(out, &name, &archive, &time(repository)?)?;
    let bytes = std::fs::read(&archive).with_context(|| archive.display().to_string())?;
    let sum = format!("{:x}", Sha256::digest(&bytes));
    // In the form that `sha256sum --check` reads.
    crate::write(&out.join(format!("{name}.tar.gz.sha256")), &format!("{sum}  {name}.tar.gz\n"))?;
    Ok(vec![version, format!("{}: {} bytes, sha256 {sum}", archive.display(), bytes.len())])
}

/// The folder in the archive, and the archive without its ending. `cargo binstall` looks for it: see `crates/cli/Cargo.toml`.
fn name() -> String {
    format!("mms-{}-{TARGET}", env!("CARGO_PKG_VERSION"))
}

/// The compiled command.
fn compile(repository: &Path) -> anyhow::Result<PathBuf> {
    let cargo = std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into());
    // What is left of an earlier build tells the commit of that build where later commits changed no sources.
    let clean = ["clean", "--quiet", "--release", "--target", TARGET, "--package", "mmsmith-cli"];
    answer(Command::new(&cargo).current_dir(repository).args(clean))?;
    let mut cargo = Command::new(cargo);
    cargo.current_dir(repository).args(["build", "--release", "--locked", "--target", TARGET]);
    cargo.args(["--package", "mmsmith-cli", "--bin", "mms"]);
    if !cargo.status().context("cannot run cargo")?.success() {
        bail!(
            "mms could not be compiled; where the target is what lacks: rustup target add {TARGET}"
        );
    }
    let target = std::env::var_os("CARGO_TARGET_DIR").map_or("target".into(), PathBuf::from);
    Ok(repository.join(target).join(TARGET).join("release/mms"))
}

/// Writes all files of the archive into `folder`.
fn fill(repository: &Path, mms: &Path, folder: &Path) -> anyhow::Result<()> {
    std::fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    let copy = |from: &Path, name: &str| {
        std::fs::copy(from, folder.join(name))
            .with_context(|| format!("cannot copy {}", from.display()))
    };
    copy(mms, "mms")?;
    for text in TEXTS {
        copy(&repository.join(text), text)?;
    }
    for (shell, file) in COMPLETIONS {
        let script = answer(Command::new(mms).args(["completions", shell]))?;
        crate::write(&folder.join("completions").join(file), &format!("{script}\n"))?;
    }
    answer(Command::new(mms).arg("man").arg(folder.join("man/man1")))?;
    Ok(())
}

/// Seconds since 1970.
fn time(repository: &Path) -> anyhow::Result<String> {
    match std::env::var("SOURCE_DATE_EPOCH") {
        Ok(time) => Ok(time),
        Err(_) => {
            answer(Command::new("git").current_dir(repository).args(["log", "-1", "--format=%ct"]))
        }
    }
}

/// Packs the folder `name` in `out`: sorted, of one time, of no user, and without what a mask of permissions adds.
fn pack(out: &Path, name: &str, archive: &Path, time: &str) -> anyhow::Result<()> {
    let mut tar = Command::new("tar");
    tar.args(["--create", "--format=ustar", "--sort=name", "--mode=u=rwX,go=rX"])
        .args(["--owner=0", "--group=0", "--numeric-owner"])
        .arg(format!("--mtime=@{time}"))
        .arg("--use-compress-program=gzip -9n")
        .arg("--file")
        .arg(archive)
        .arg("--directory")
        .arg(out)
        .arg(name);
    answer(&mut tar)?;
    Ok(())
}

/// The output of a command, which has to succeed.
fn answer(command: &mut Command) -> anyhow::Result<String> {
    let shown = command.get_program().display().to_string();
    let done = command.output().with_context(|| format!("cannot start {shown}"))?;
    if !done.status.success() {
        bail!("{shown} ends with {}:\n{}", done.status, String::from_utf8_lossy(&done.stderr));
    }
    let text = String::from_utf8(done.stdout).with_context(|| format!("{shown} prints no text"))?;
    Ok(text.trim_end().to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::fs;
    use std::time::{Duration, SystemTime};

    #[test]
    fn an_archive_tells_neither_when_nor_by_whom_it_was_packed() {
        let place = tempfile::tempdir().unwrap();
        let mut archives = Vec::new();
        for (number, order) in [["b", "a"], ["a", "b"]].into_iter().enumerate() {
            let out = place.path().join(number.to_string());
            let folder = out.join("it/inner");
            fs::create_dir_all(&folder).unwrap();
            for file in order {
                let path = folder.join(file);
                fs::write(&path, file).unwrap();
                let time = SystemTime::now() - Duration::from_secs(1000 * number as u64);
                fs::File::options().append(true).open(&path).unwrap().set_modified(time).unwrap();
                #[cfg(unix)]
                {
                    use std::os::unix::fs::PermissionsExt;
                    let mode = [0o600, 0o664][number];
                    fs::set_permissions(&path, fs::Permissions::from_mode(mode)).unwrap();
                }
            }
            let archive = out.join("it.tar.gz");
            pack(&out, "it", &archive, "1000000000").unwrap();
            archives.push(fs::read(archive).unwrap());
        }
        assert!(!archives[0].is_empty());
        assert_eq!(archives[0], archives[1]);
        let listed = answer(
            Command::new("tar").args(["--utc", "-tvzf"]).arg(place.path().join("0/it.tar.gz")),
        )
        .unwrap();
        let lines: Vec<&str> = listed.lines().collect();
        assert_eq!(lines.len(), 4, "{listed}");
        assert!(lines[2].starts_with("-rw-r--r-- 0/0"), "{listed}");
        assert!(lines[2].ends_with("2001-09-09 01:46 it/inner/a"), "{listed}");
    }

    #[test]
    fn the_archive_lies_where_installers_look() {
        let manifest = Path::new(env!("CARGO_MANIFEST_DIR")).join("../crates/cli/Cargo.toml");
        let stated = fs::read_to_string(manifest)
            .unwrap()
            .replace("{ version }", env!("CARGO_PKG_VERSION"))
            .replace("{ target }", TARGET);
        let name = name();
        assert!(stated.contains(&format!("/{name}.tar.gz\"")), "{name}");
        assert!(stated.contains(&format!("bin-dir = \"{name}/{{ bin }}")), "{name}");
    }
}
