//! `topipe log`.

use crate::args::LogArguments;
use crate::display;
use crate::failure::Failure;
use crate::stages::registry;
use std::fmt::Write;
use topipe_engine::{Action, Choice, ExitCode, plan};

pub(crate) fn run(arguments: &LogArguments) -> Result<ExitCode, Failure> {
    let pipeline = super::pipeline::load(&arguments.pipeline.pipeline, &arguments.pipeline.set, &registry())?;
    let cache = crate::remote::cache(&arguments.pipeline)?;
    let choice = Choice { until: arguments.stage.iter().cloned().collect(), ..Choice::default() };
    let plan = plan(&pipeline, &cache, &choice)?;
    let mut text = String::new();
    for stage in
        plan.stages.iter().filter(|stage| arguments.stage.as_ref().is_none_or(|name| *name == stage.stage))
    {
        let record = match (&stage.action, stage.key) {
            (Action::Cached, Some(key)) => cache.key_record(key, &mut Vec::new())?,
            _ => None,
        };
        let Some(record) = record else {
            let _ = writeln!(text, "{}: no result in the cache", stage.stage);
            continue;
        };
        let _ = writeln!(text, "{}: computed in {}", stage.stage, display::duration(record.seconds));
        for warning in record.warnings {
            let _ = writeln!(text, "{}: warning: {warning}", stage.stage);
        }
        for remark in record.remarks {
            let _ = writeln!(text, "{}: {remark}", stage.stage);
        }
    }
    super::print(&text)
}
