//! A disk with no room left, for tests of what happens then.
//!
//! A script finds a file system of its own at `$DISK`: a `tmpfs` in a name space that ends with the script. Where nothing may
//! be mounted, as in most containers, and beside it everywhere else, a small library that stands before the C library
//! answers writes below `$DISK` as a full disk does. In the script, `fill BYTES` leaves so much room and `make_room` takes
//! that back; a mounted one can `make_read_only`.

use std::path::{Path, PathBuf};
use std::process::Command;

/// A disk that can be filled.
#[derive(Debug)]
pub(crate) enum SmallDisk {
    /// A file system, mounted in a name space made by this command.
    Mounted(&'static [&'static str]),
    /// A folder, and the library that stands before the C library.
    Preloaded(PathBuf),
}

const MOUNT: &str = r#"
mount -t tmpfs -o size=256m none "$DISK" || exit 77
fill() {
    rm -f "$DISK/ballast"
    head -c $(($(df -B1 --output=avail "$DISK" | tail -n 1) - $1)) /dev/zero > "$DISK/ballast"
}
make_room() { rm "$DISK/ballast"; }
make_read_only() { mount -o remount,ro "$DISK"; }
"#;

const PRELOAD: &str = r#"
fill() { echo "$1" > "$DISK/ballast"; }
make_room() { rm "$DISK/ballast"; }
run() { LD_PRELOAD="$FULL" "$@"; }
"#;

impl SmallDisk {
    /// All that can be had here; `folder` is for the library. There is always at least one.
    pub(crate) fn all(folder: &Path) -> Vec<Self> {
        let disk = folder.join("probe");
        std::fs::create_dir(&disk).unwrap();
        let unshare: [&'static [&'static str]; 2] = [&["unshare", "-rm"], &["unshare", "-m"]];
        let mounted = unshare.into_iter().map(Self::Mounted).find(|mounted| {
            mounted.script(&disk, "true").output().is_ok_and(|output| output.status.success())
        });
        let library = folder.join("full.so");
        let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../tests/small_disk/full.c");
        let mut compiler = Command::new("cc");
        compiler.args(["-O1", "-shared", "-fPIC", "-o"]).arg(&library).arg(source).arg("-ldl");
        let built = compiler.output().is_ok_and(|output| output.status.success());
        let disks: Vec<Self> = mounted.into_iter().chain(built.then_some(Self::Preloaded(library))).collect();
        assert!(!disks.is_empty(), "neither can anything be mounted here nor does `cc` work");
        disks
    }

    /// A shell that runs `script` with the disk at the existing folder `disk`. Programs that shall meet the full disk are
    /// called with `run` before them.
    pub(crate) fn script(&self, disk: &Path, script: &str) -> Command {
        let mut shell;
        let prelude = match self {
            Self::Mounted(unshare) => {
                shell = Command::new(unshare[0]);
                shell.args(&unshare[1..]).arg("sh");
                format!("{MOUNT}run() {{ \"$@\"; }}\n")
            }
            Self::Preloaded(library) => {
                shell = Command::new("sh");
                shell.env("FULL", library);
                PRELOAD.to_owned()
            }
        };
        shell.arg("-c").arg(format!("{prelude}{script}")).arg("sh").env("DISK", disk);
        shell
    }
}
