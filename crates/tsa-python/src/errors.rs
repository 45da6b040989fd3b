//! Failures as the exceptions of `tsa_rig`, in the words of Python.

use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;
use rigctl::failure::Failure;

/// What the tool's messages name, and what it is in Python.
const WORDS: [(&str, &str); 22] = [
    ("; name a scene that is there with --scene FILE", ""),
    ("`rigctl home`", "`home()`"),
    ("`rigctl stop`", "`stop()`"),
    ("`rigctl clear`", "`clear()`"),
    ("`rigctl jog`", "`jog()`"),
    ("`home`", "`home()`"),
    ("`stop`", "`stop()`"),
    ("`clear`", "`clear()`"),
    ("`config set`", "`config.set()`"),
    ("`config restore`", "`config.restore()`"),
    ("`table --board`", "`make_table()`"),
    ("--force", "force=True"),
    ("--load", "load_n"),
    ("--after", "after_n"),
    ("--turns", "turns"),
    ("--speed", "speed_rad_per_s"),
    ("--seconds", "seconds"),
    ("--gap", "gap_m"),
    ("--point", "point"),
    ("--port", "port"),
    ("--plant", "plant"),
    ("--scene", "scene"),
];

/// A message of the tool with Python's names.
pub(crate) fn in_python(message: &str) -> String {
    WORDS.iter().fold(message.to_owned(), |text, (tool, python)| text.replace(tool, python))
}

/// The exception of a kind (`_errors.py`), with a message of the tool.
pub(crate) fn of_kind(kind: &str, message: &str) -> PyErr {
    let text = in_python(message);
    Python::attach(|py| {
        let errors = py.import("tsa_rig._errors");
        let made = errors.and_then(|errors| errors.call_method1("of_kind", (kind, text.trim_end())));
        made.map_or_else(|e| e, PyErr::from_value)
    })
}

/// A wrong argument.
pub(crate) fn wrong(error: impl std::fmt::Display) -> PyErr {
    of_kind("bad-request", &error.to_string())
}

/// The error of a failed command.
pub(crate) fn error(failure: impl Into<Failure>) -> PyErr {
    let failure = failure.into();
    of_kind(failure.kind(), &failure.message().unwrap_or_else(|| "failed".into()))
}

/// What cannot happen: something of ours that is no JSON.
pub(crate) fn broken(error: impl std::fmt::Display) -> PyErr {
    PyRuntimeError::new_err(error.to_string())
}
