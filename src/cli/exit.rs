use crate::base::{FaultKind, Interrupted};

/// What an error means for the process: the first cause that a room classified decides.
pub fn exit_code(error: &anyhow::Error) -> FaultKind {
    error.chain().find_map(classify).unwrap_or(FaultKind::Failed)
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
        super::ours::Error,
        crate::glare::Error,
        crate::pages::Error,
        crate::picture::Error,
        crate::render::Error,
        crate::run::Error,
        crate::site::Error,
        crate::site::bsdf::Error,
        crate::sky::Error,
        crate::trace::Error,
        crate::volume::Error,
    );
    None
}
