use super::Context;

#[derive(Debug, clap::Subcommand)]
pub(super) enum Command {
    Stub,
}

pub(super) fn run(_command: &Command, _context: &Context) -> anyhow::Result<()> {
    anyhow::bail!("not built yet")
}
