//! How a command fails, and with which exit code.

/// A failed command.
#[derive(Debug)]
pub enum Failure {
    /// Wrong usage: exit code 2.
    Usage(String),
    /// Refused or failed: exit code 1.
    Failed(anyhow::Error),
    /// Failed, and already said on standard error: exit code 1.
    Reported,
}

impl Failure {
    /// A refusal or failure in words.
    pub fn failed(message: impl Into<String>) -> Self {
        Self::Failed(anyhow::Error::msg(message.into()))
    }

    /// As an error of a program on the library: `.map_err(Failure::into_error)?`.
    pub fn into_error(self) -> anyhow::Error {
        match self {
            Self::Usage(message) => anyhow::Error::msg(message),
            Self::Failed(error) => error,
            Self::Reported => anyhow::Error::msg("failed, and already said"),
        }
    }

    /// What to print, with its causes.
    pub fn message(&self) -> Option<String> {
        match self {
            Self::Usage(message) => Some(message.clone()),
            Self::Failed(error) => Some(format!("{error:#}")),
            Self::Reported => None,
        }
    }

    /// Whether the reader of our output has gone.
    pub fn is_broken_pipe(&self) -> bool {
        let Self::Failed(error) = self else { return false };
        error.downcast_ref::<std::io::Error>().is_some_and(|e| e.kind() == std::io::ErrorKind::BrokenPipe)
    }
}

impl<E: Into<anyhow::Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}
