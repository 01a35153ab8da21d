use std::io::Write;

use crate::base::{FaultKind, Interrupted};
use crate::project::Mistakes;
use crate::{project, receivers, run};

/// What an error means for the process: the first cause that a room classified decides.
pub fn exit_code(error: &anyhow::Error) -> FaultKind {
    error
        .chain()
        .find_map(classify)
        .or_else(|| error.chain().find_map(named))
        .unwrap_or(FaultKind::Failed)
}

/// Where no room had a say: names of the command line that lead nowhere.
fn named(cause: &(dyn std::error::Error + 'static)) -> Option<FaultKind> {
    use std::io::ErrorKind;
    let kind = cause.downcast_ref::<std::io::Error>()?.kind();
    matches!(
        kind,
        ErrorKind::NotFound
            | ErrorKind::PermissionDenied
            | ErrorKind::AlreadyExists
            | ErrorKind::NotADirectory
            | ErrorKind::IsADirectory
    )
    .then_some(FaultKind::Input)
}

fn classify(cause: &(dyn std::error::Error + 'static)) -> Option<FaultKind> {
    macro_rules! rooms {
        ($($error:ty),* $(,)?) => {
            $(if let Some(e) = cause.downcast_ref::<$error>() {
                return Some(e.kind());
            })*
        };
    }
    if cause.is::<Interrupted>() {
        return Some(FaultKind::Interrupted);
    }
    rooms!(
        super::own_format::Error,
        crate::glare::Error,
        crate::pages::Error,
        crate::picture::Error,
        crate::render::Error,
        crate::render::GatherError,
        project::Error,
        receivers::Error,
        crate::report::Error,
        crate::rules::Error,
        run::Error,
        crate::site::Error,
        crate::bsdf::Error,
        crate::sky::Error,
        crate::trace::Error,
        crate::volume::Error,
    );
    None
}

/// The mistakes of a project file, whichever room came upon them.
fn mistakes<'e>(cause: &'e (dyn std::error::Error + 'static)) -> Option<&'e Mistakes> {
    let of = |e: &'e project::Error| match e {
        project::Error::Project(mistakes) => Some(mistakes),
        _ => None,
    };
    let met = |e: &'e receivers::Error| match e {
        receivers::Error::Project(e) => of(e),
        _ => None,
    };
    cause.downcast_ref().and_then(of).or_else(|| cause.downcast_ref().and_then(met)).or_else(|| {
        match cause.downcast_ref()? {
            run::Error::Project(e) => of(e),
            run::Error::Receivers(e) => met(e),
            _ => None,
        }
    })
}

/// Prints an error on standard error: where, what was expected, what was found, and why. With
/// `json` as one line `{"error", "because", "kind", "exit_code"}`, and of mistakes in a project file
/// also `"file"` and `"mistakes"`, a list of `{"line", "column", "message"}`.
pub fn tell(error: &anyhow::Error, json: bool) {
    // Errors that say their source's words already: nobody needs to read them twice.
    let mut causes: Vec<String> = Vec::new();
    for cause in error.chain().map(ToString::to_string) {
        if !causes.last().is_some_and(|above| above.contains(&cause)) {
            causes.push(cause);
        }
    }
    let (first, because) = causes.split_first().map_or(("", &[][..]), |(f, b)| (f.as_str(), b));
    let mut text = if json {
        let kind = exit_code(error);
        let mut line = serde_json::json!({
            "error": first,
            "because": because,
            "kind": kind,
            "exit_code": kind.exit_code(),
        });
        if let Some(Mistakes { path, list }) = error.chain().find_map(mistakes) {
            line["file"] = path.display().to_string().into();
            line["mistakes"] = serde_json::json!(list);
        }
        line.to_string()
    } else {
        format!("glintmap: {first}")
    };
    if !json {
        for cause in because {
            text += &format!("\n  because: {cause}");
        }
    }
    text.push('\n');
    // Standard error may be closed: then nobody listens, and the exit code says enough.
    let _ = std::io::stderr().write_all(text.as_bytes());
}
