//! The results of a run, as far as the cache has them.

use super::unfinished::{self, Measured};
use crate::artifacts;
use rayon::prelude::*;
use std::collections::HashMap;
use std::sync::Arc;
use topipe_engine::{ArtifactKind, Cache, Registry, RunRecord, StageRecord, Value};
use topipe_mesh::Part;
use topipe_validation::Report;

/// Results in memory by the names of their stages.
pub(super) type Known = HashMap<String, Value>;

/// The results by stage, in the order of the record.
pub(super) struct Results<'a> {
    record: &'a RunRecord,
    values: Vec<Option<Value>>,
    /// The figures of validations that gave none.
    measured: Vec<Measured>,
    /// What is not there, one sentence each.
    pub(super) missing: Vec<String>,
}

impl<'a> Results<'a> {
    /// Those that are `known` are not read.
    pub(super) fn load(record: &'a RunRecord, cache: &Cache, registry: &Registry, known: &Known) -> Self {
        let load = |stage: &StageRecord| {
            if let Some(value) = known.get(&stage.stage) {
                return Some(Arc::clone(value));
            }
            let artifact = registry.artifact(&stage.artifact_kind)?;
            // Damage is told of by the next run, which needs the result for more than a picture.
            cache.load(&artifact, stage.artifact?, &mut Vec::new()).ok().flatten()
        };
        let values: Vec<Option<Value>> = record.stages.par_iter().map(load).collect();
        let missing =
            record.stages.iter().zip(&values).filter(|(_, value)| value.is_none()).map(|(stage, _)| {
                let why = if stage.artifact.is_some() {
                    "is no longer in the cache"
                } else {
                    "is missing: it was not computed"
                };
                format!("The {} of stage {} {why}.", stage.artifact_kind, stage.stage)
            });
        Self { missing: missing.collect(), measured: Vec::new(), record, values }
    }

    /// The stages whose results are there, with those.
    pub(super) fn known(&self) -> Known {
        let all = self.record.stages.iter().zip(&self.values);
        all.filter_map(|(stage, value)| Some((stage.stage.clone(), value.clone()?))).collect()
    }

    /// Measures what there is for validations that gave no report.
    pub(super) fn measure_unfinished(&mut self) {
        let measured: Vec<_> =
            self.record.stages.iter().filter_map(|stage| unfinished::measure(stage, self)).collect();
        for one in measured {
            match one {
                Ok(measured) => self.measured.push(measured),
                Err(why) => self.missing.push(why),
            }
        }
    }

    /// The result at a port of a stage.
    pub(super) fn input<K: ArtifactKind>(&self, stage: &StageRecord, port: &str) -> Option<&K::Value> {
        self.value::<K>(self.stage(&stage.inputs.get(port)?.stage)?)
    }

    /// All results of one kind with their stages.
    pub(super) fn of<K: ArtifactKind>(&self) -> Vec<(&'a StageRecord, &K::Value)> {
        let all = self.record.stages.iter().zip(&self.values);
        all.filter_map(|(stage, value)| Some((stage, value.as_ref()?.downcast_ref::<K::Value>()?))).collect()
    }

    fn value<K: ArtifactKind>(&self, stage: &StageRecord) -> Option<&K::Value> {
        let at = self.record.stages.iter().position(|other| other.stage == stage.stage)?;
        self.values[at].as_ref()?.downcast_ref::<K::Value>()
    }

    fn stage(&self, name: &str) -> Option<&'a StageRecord> {
        self.record.stages.iter().find(|stage| stage.stage == name)
    }

    /// The mesh that a stage's result was made from: that of the nearest stage before it which gives one.
    pub(super) fn mesh_before(&self, stage: &StageRecord) -> Option<(&'a StageRecord, &Part)> {
        let mut open: Vec<&StageRecord> = self.inputs(stage);
        // No stage is farther away than there are stages.
        for _ in 0..self.record.stages.len() {
            for stage in &open {
                if let Some(part) = self.value::<artifacts::Mesh>(stage) {
                    return Some((self.stage(&stage.stage)?, part));
                }
            }
            open = open.iter().flat_map(|stage| self.inputs(stage)).collect();
        }
        None
    }

    /// The first mesh on the way to a stage's result.
    pub(super) fn original(&self, stage: &StageRecord) -> Option<(&'a StageRecord, &Part)> {
        let mut found = self.mesh_before(stage)?;
        for _ in 0..self.record.stages.len() {
            match self.mesh_before(found.0) {
                Some(before) => found = before,
                None => break,
            }
        }
        Some(found)
    }

    fn inputs(&self, stage: &StageRecord) -> Vec<&'a StageRecord> {
        stage.inputs.values().filter_map(|input| self.stage(&input.stage)).collect()
    }

    /// The reports with their stages, and whether each is the stage's own or was measured for the page.
    pub(super) fn reports(&self) -> Vec<(&str, &Report, bool)> {
        let own = self.of::<artifacts::Report>().into_iter();
        let own = own.map(|(stage, report)| (stage.stage.as_str(), report, true));
        own.chain(self.measured.iter().map(|m| (m.stage.as_str(), &m.report, false))).collect()
    }
}
