//! What the user should know: one sentence each, equal ones gathered with the names they are about.

/// Names listed before "and N more".
const LISTED: usize = 4;

/// Warnings in the order in which their kinds first came up.
#[derive(Default)]
pub(super) struct Warnings(Vec<(String, Vec<String>)>);

impl Warnings {
    /// A sentence about the whole file; said once.
    pub fn say(&mut self, sentence: impl Into<String>) {
        let sentence = sentence.into();
        if !self.0.iter().any(|(s, _)| *s == sentence) {
            self.0.push((sentence, Vec::new()));
        }
    }

    /// A sentence about `name`; the names of equal sentences are gathered.
    pub fn about(&mut self, name: impl Into<String>, sentence: impl Into<String>) {
        let (name, sentence) = (name.into(), sentence.into());
        match self.0.iter_mut().find(|(s, names)| *s == sentence && !names.is_empty()) {
            Some((_, names)) if names.contains(&name) => {}
            Some((_, names)) => names.push(name),
            None => self.0.push((sentence, vec![name])),
        }
    }

    pub fn sentences(&self) -> Vec<String> {
        self.0.iter().map(|(sentence, names)| joined(sentence, names)).collect()
    }
}

fn joined(sentence: &str, names: &[String]) -> String {
    let listed = names[..names.len().min(LISTED)].join(", ");
    match names.len() {
        0 => sentence.into(),
        n if n > LISTED => format!("{listed} and {} more: {sentence}", n - LISTED),
        _ => format!("{listed}: {sentence}"),
    }
}
