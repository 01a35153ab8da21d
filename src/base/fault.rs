use std::io;

/// What kind of failure an error is. Every room's error enum has `fn kind(&self) -> FaultKind`;
/// the command line turns it into the exit code.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FaultKind {
    /// The run failed (a full disk): exit code 1.
    Failed,
    /// The command or an input is wrong: exit code 2.
    Input,
    /// Data of ours on disk is damaged: exit code 3.
    Damaged,
    /// A rule named with `--fail-on` is exceeded: exit code 4.
    Exceeded,
    /// The user asked to stop: exit code 130.
    Interrupted,
}

impl FaultKind {
    /// The process's exit code.
    pub fn exit_code(self) -> u8 {
        match self {
            Self::Failed => 1,
            Self::Input => 2,
            Self::Damaged => 3,
            Self::Exceeded => 4,
            Self::Interrupted => 130,
        }
    }
    /// What it means that a file can't be read: what was named is no such file (another name, other
    /// rights, another kind of file), or the system failed.
    pub fn of_reading(error: &io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::NotFound
            | io::ErrorKind::PermissionDenied
            | io::ErrorKind::IsADirectory
            | io::ErrorKind::NotADirectory
            | io::ErrorKind::InvalidData => Self::Input,
            _ => Self::Failed,
        }
    }

    /// What it means that a file can't be written: its name leads through a file or to something
    /// that is not ours to write, or the system failed.
    pub fn of_writing(error: &io::Error) -> Self {
        match error.kind() {
            io::ErrorKind::AlreadyExists
            | io::ErrorKind::NotADirectory
            | io::ErrorKind::IsADirectory
            | io::ErrorKind::PermissionDenied
            | io::ErrorKind::ReadOnlyFilesystem => Self::Input,
            _ => Self::Failed,
        }
    }
}
