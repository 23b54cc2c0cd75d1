//! Files that appear under their name in one step, whole, and leave nothing behind when the process dies before.
//!
//! A file is written under a temporary name, flushed where its loss would cost something, and renamed. While it is
//! written its process holds an OS lock on it, which the system gives back however the process ends: a temporary file
//! that can be locked is nobody's, and the next run removes it.

use super::CacheError;
use super::lock::is_still_at;
use std::fs::File;
use std::io::Write;
use std::path::Path;

const PREFIX: &str = ".topipe-";

/// Whether a file outlives a loss of power.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Durability {
    /// It is on the disk before its name appears.
    Flushed,
    /// It may be lost with the power; it is checked when it is read, and its loss costs next to nothing.
    Unflushed,
}

/// A file that has no name yet. Deleted when dropped.
pub(crate) struct Temporary {
    file: tempfile::NamedTempFile,
}

impl Temporary {
    /// A new file in `folder`, which is made if need be.
    pub(crate) fn new(folder: &Path) -> std::io::Result<Self> {
        std::fs::create_dir_all(folder)?;
        loop {
            let file = tempfile::Builder::new().prefix(PREFIX).tempfile_in(folder)?;
            // Where files cannot be locked nobody else can lock this one either, so it is safe as well.
            let locked = file.as_file().lock().is_ok();
            // A run that cleans up may have removed it before it was locked.
            if !locked || is_still_at(file.as_file(), file.path()) {
                return Ok(Self { file });
            }
        }
    }

    /// A new file in the folder of `path`.
    pub(crate) fn beside(path: &Path) -> std::io::Result<Self> {
        Self::new(path.parent().filter(|folder| *folder != Path::new("")).unwrap_or(Path::new(".")))
    }

    /// Gives it its name, readable as any other file.
    pub(crate) fn persist(self, path: &Path, durability: Durability) -> std::io::Result<()> {
        #[cfg(unix)]
        {
            use std::os::unix::fs::PermissionsExt;
            // Temporary files are private; what is shared should not be.
            self.file.as_file().set_permissions(std::fs::Permissions::from_mode(0o644))?;
        }
        crate::failpoint::pass("temporary written");
        if durability == Durability::Flushed {
            self.file.as_file().sync_data()?;
            crate::failpoint::pass("temporary flushed");
        }
        self.file.persist(path).map_err(|error| error.error)?;
        crate::failpoint::pass("file renamed");
        Ok(())
    }
}

impl Write for Temporary {
    fn write(&mut self, buffer: &[u8]) -> std::io::Result<usize> {
        self.file.as_file_mut().write(buffer)
    }

    fn flush(&mut self) -> std::io::Result<()> {
        self.file.as_file_mut().flush()
    }
}

/// Writes a file so that it appears in one step, whole: beside its place, flushed to the disk, then renamed.
pub fn write_atomically(path: &Path, bytes: &[u8]) -> Result<(), CacheError> {
    let write = || {
        let mut file = Temporary::beside(path)?;
        file.write_all(bytes)?;
        file.persist(path, Durability::Flushed)
    };
    write().map_err(|error| CacheError::io("write", path, error))
}

/// Removes temporary files in `folder` whose processes have died. What cannot be removed stays.
pub(crate) fn sweep(folder: &Path) {
    for entry in std::fs::read_dir(folder).into_iter().flatten().flatten() {
        if entry.file_name().to_string_lossy().starts_with(PREFIX) {
            remove_if_nobodys(&entry.path());
        }
    }
}

/// Removes a file unless a process holds its lock.
pub(super) fn remove_if_nobodys(path: &Path) -> bool {
    let Ok(file) = File::options().read(true).write(true).open(path) else { return false };
    // Removed while held: a process that opened it meanwhile sees that it is gone.
    file.try_lock().is_ok() && is_still_at(&file, path) && std::fs::remove_file(path).is_ok()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn names(folder: &Path) -> Vec<String> {
        let mut names: Vec<String> = std::fs::read_dir(folder)
            .unwrap()
            .map(|entry| entry.unwrap().file_name().into_string().unwrap())
            .collect();
        names.sort();
        names
    }

    #[test]
    fn files_in_the_making_stay_and_those_of_the_dead_go() {
        let folder = tempfile::tempdir().unwrap();
        let mut alive = Temporary::new(folder.path()).unwrap();
        std::fs::write(folder.path().join(".topipe-dead"), "x").unwrap();
        std::fs::write(folder.path().join("other"), "x").unwrap();
        sweep(folder.path());
        assert_eq!(names(folder.path()).len(), 2);
        alive.write_all(b"whole").unwrap();
        alive.persist(&folder.path().join("file"), Durability::Flushed).unwrap();
        assert_eq!(names(folder.path()), ["file", "other"]);
        assert_eq!(std::fs::read(folder.path().join("file")).unwrap(), b"whole");
    }

    #[test]
    fn many_writers_and_sweepers_do_not_disturb_each_other() {
        let folder = tempfile::tempdir().unwrap();
        std::thread::scope(|scope| {
            for writer in 0..4 {
                let folder = folder.path();
                scope.spawn(move || {
                    for round in 0..50 {
                        write_atomically(&folder.join(format!("{writer}")), &[round; 100]).unwrap();
                    }
                });
                scope.spawn(move || (0..200).for_each(|_| sweep(folder)));
            }
        });
        assert_eq!(names(folder.path()), ["0", "1", "2", "3"]);
    }
}
