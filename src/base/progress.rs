/// The user asked the program to stop. Work that was sealed stays; the same command resumes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, thiserror::Error)]
#[error("interrupted; run the same command again to go on from here")]
pub struct Interrupted;

/// Where long work reports how far it is, and learns that it should stop. Implementations count;
/// rate and time left are theirs to derive.
pub trait Progress: Send + Sync {
    /// A piece of work begins: its name, how many units it will take, and what a unit is.
    fn begin(&self, what: &str, total: u64, unit: &str);
    /// `units` more are done.
    fn advance(&self, units: u64);
    /// The piece of work is done.
    fn finish(&self);
    /// Something the user should know now; goes to the log as well.
    fn say(&self, message: &str);
    /// `Err` once the user asked to stop. Loops ask at least once a second.
    ///
    /// # Errors
    /// [`Interrupted`], to be passed up unchanged.
    fn check(&self) -> Result<(), Interrupted>;
}

/// Progress that nobody watches: for tests and for library users.
#[derive(Clone, Copy, Debug, Default)]
pub struct Silent;

impl Progress for Silent {
    fn begin(&self, _what: &str, _total: u64, _unit: &str) {}
    fn advance(&self, _units: u64) {}
    fn finish(&self) {}
    fn say(&self, _message: &str) {}
    fn check(&self) -> Result<(), Interrupted> {
        Ok(())
    }
}
