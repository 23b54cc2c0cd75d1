//! How much of what a stage is going to need is there already.

use super::checkpoints::{folder, open_all};
use super::segment::{self, RecordKind};
use super::{Cache, Damage};
use crate::hash::ContentHash;
use serde::Serialize;
use std::collections::HashSet;
use std::fs::File;
use topipe_progress::UnitKey;

/// Units of one sort that a stage is going to need.
#[derive(Debug, Clone, PartialEq, Eq, Serialize)]
pub struct UnitsAtHand {
    /// What they are: "patches".
    pub what: String,
    /// So many are in the cache
    pub kept: u64,
    /// of so many.
    pub total: u64,
}

impl Cache {
    /// What an interrupted run with the key `stage` said it needs, and how much of it is there.
    pub(crate) fn units_of_interrupted_run(
        &self,
        kind: &str,
        code_version: &str,
        stage: ContentHash,
        damages: &mut Vec<Damage>,
    ) -> Vec<UnitsAtHand> {
        let folder = folder(self.root(), kind, code_version);
        let path = folder.join(stage.to_hex());
        let Ok(file) = File::open(&path) else { return Vec::new() };
        let Ok(contents) = segment::contents(&file, stage) else { return Vec::new() };
        let lists = contents.records.iter().filter(|record| record.kind == RecordKind::List);
        let mut needed: Vec<(String, Vec<UnitKey>)> = Vec::new();
        for list in lists {
            // The last run says it again: only the newest list of a name counts.
            let Some((what, keys)) =
                segment::read(&file, list).ok().flatten().and_then(|value| segment::parse_list(&value))
            else {
                continue;
            };
            needed.retain(|(known, _)| *known != what);
            needed.push((what, keys));
        }
        self.units_at_hand(kind, code_version, &needed, damages)
    }

    /// How many of these units are there.
    pub(crate) fn units_at_hand(
        &self,
        kind: &str,
        code_version: &str,
        needed: &[(String, Vec<UnitKey>)],
        damages: &mut Vec<Damage>,
    ) -> Vec<UnitsAtHand> {
        if needed.is_empty() {
            return Vec::new();
        }
        let (segments, found) = open_all(self, &folder(self.root(), kind, code_version));
        damages.extend(found);
        let there: HashSet<UnitKey> = segments
            .iter()
            .flat_map(|(_, contents)| &contents.records)
            .filter(|record| record.kind == RecordKind::Unit)
            .map(|record| record.key)
            .collect();
        needed
            .iter()
            .map(|(what, keys)| UnitsAtHand {
                what: what.clone(),
                kept: keys.iter().filter(|key| there.contains(key)).count() as u64,
                total: keys.len() as u64,
            })
            .collect()
    }
}
