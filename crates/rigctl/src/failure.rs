//! How a command fails, and with which exit code.

use crate::output::ReaderGone;

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
            Self::Failed(error) => {
                let mut text = String::new();
                // Some errors tell their causes themselves.
                for cause in error.chain().map(ToString::to_string) {
                    match text.as_str() {
                        "" => text = cause,
                        told if told.contains(cause.trim()) => {}
                        _ => text += &format!(": {cause}"),
                    }
                }
                Some(text)
            }
            Self::Reported => None,
        }
    }

    /// Whether the reader of our standard output has gone; a serial line that has gone is another matter.
    pub fn is_reader_gone(&self) -> bool {
        let Self::Failed(error) = self else { return false };
        error.downcast_ref::<std::io::Error>().and_then(std::io::Error::get_ref).is_some_and(|e| e.is::<ReaderGone>())
    }
}

impl<E: Into<anyhow::Error>> From<E> for Failure {
    fn from(error: E) -> Self {
        Self::Failed(error.into())
    }
}
