//! What the user should know: one sentence each, equal ones gathered with the names they are about.

use std::collections::{HashMap, HashSet};

/// Names listed before "and N more".
const LISTED: usize = 4;

/// Warnings in the order in which their sentences first came up.
#[derive(Default)]
pub(super) struct Warnings {
    gathered: Vec<Gathered>,
    index: HashMap<String, usize>,
}

struct Gathered {
    sentence: String,
    listed: Vec<String>,
    names: HashSet<String>,
}

impl Warnings {
    /// A sentence about the whole file; said once.
    pub fn say(&mut self, sentence: impl Into<String>) {
        self.entry(sentence.into());
    }

    /// A sentence about `name`; the names of equal sentences are gathered.
    pub fn about(&mut self, name: impl Into<String>, sentence: impl Into<String>) {
        let name = name.into();
        let entry = self.entry(sentence.into());
        if entry.names.insert(name.clone()) && entry.listed.len() < LISTED {
            entry.listed.push(name);
        }
    }

    /// All of them, ready to print.
    pub fn sentences(&self) -> Vec<String> {
        self.gathered.iter().map(Gathered::text).collect()
    }

    fn entry(&mut self, sentence: String) -> &mut Gathered {
        let next = self.gathered.len();
        let at = *self.index.entry(sentence.clone()).or_insert(next);
        if at == next {
            self.gathered.push(Gathered { sentence, listed: Vec::new(), names: HashSet::new() });
        }
        &mut self.gathered[at]
    }
}

impl Gathered {
    fn text(&self) -> String {
        let listed = self.listed.join(", ");
        match self.names.len() {
            0 => self.sentence.clone(),
            n if n > LISTED => format!("{listed} and {} more: {}", n - LISTED, self.sentence),
            _ => format!("{listed}: {}", self.sentence),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_sentences_are_gathered() {
        let mut w = Warnings::default();
        w.say("once");
        w.say("once");
        ["a", "b", "c", "d", "e", "a"].iter().for_each(|n| w.about(*n, "is odd"));
        w.about("a", "is even");
        assert_eq!(w.sentences(), ["once", "a, b, c, d and 1 more: is odd", "a: is even"]);
    }
}
