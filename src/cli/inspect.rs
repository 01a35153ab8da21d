use super::Context;

#[derive(Debug, clap::Args)]
pub(super) struct Arguments {}

pub(super) fn run(_arguments: &Arguments, _context: &Context) -> anyhow::Result<()> {
    anyhow::bail!("not built yet")
}
