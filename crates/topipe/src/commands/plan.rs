//! `topipe plan`.

use crate::args::PlanArguments;
use crate::failure::Failure;
use crate::stages::registry;
use std::fmt::Write;
use topipe_engine::{Action, ExitCode, Plan, PlannedUnits, UnitsAtHand, plan};

pub(crate) fn run(arguments: &PlanArguments) -> Result<ExitCode, Failure> {
    let pipeline = super::pipeline::load(&arguments.pipeline.pipeline, &arguments.pipeline.set, &registry())?;
    let cache = crate::remote::cache(&arguments.pipeline)?;
    let plan = plan(&pipeline, &cache, &arguments.choice.choice())?;
    for damage in &plan.damages {
        tracing::warn!("{}: {}; moved aside", damage.path.display(), damage.reason);
    }
    let text = if arguments.json {
        serde_json::to_string(&plan)
            .map_err(|error| Failure::new(ExitCode::Storage, format!("cannot write the plan: {error}")))?
            + "\n"
    } else {
        describe(&plan)
    };
    super::print(&text)
}

fn describe(plan: &Plan) -> String {
    let width = |of: fn(&topipe_engine::PlannedStage) -> usize| plan.stages.iter().map(of).max().unwrap_or(0);
    let (names, kinds) = (width(|stage| stage.stage.chars().count()), width(|stage| stage.kind.len()));
    let mut text = format!("{}\n", plan.pipeline);
    for stage in &plan.stages {
        let action = match &stage.action {
            Action::Cached => "cached".to_owned(),
            Action::Run => "runs".to_owned(),
            // What has changed already makes it run, unless the result of just this is known.
            Action::Depends { on } if !stage.reasons.is_empty() => format!("runs after {}", list(on, "and")),
            Action::Depends { on } => format!("runs if {} gives another result", list(on, "or")),
            Action::Missing => "is not selected and has no result: run it first".to_owned(),
        };
        let _ = writeln!(text, "  {:names$}  {:kinds$}  {action}", stage.stage, stage.kind);
        for reason in &stage.reasons {
            let _ = writeln!(text, "  {:names$}  {:kinds$}    {reason}", "", "");
        }
        if let Some(units) = &stage.units {
            let _ = writeln!(text, "  {:names$}  {:kinds$}    {}", "", "", parts_at_hand(units));
        }
    }
    text
}

/// "a, b or c".
fn list(names: &[String], last: &str) -> String {
    match names {
        [] => String::new(),
        [one] => one.clone(),
        [before @ .., end] => format!("{} {last} {end}", before.join(", ")),
    }
}

/// "resumes: 812 of 876 patches kept from an interrupted run".
fn parts_at_hand(units: &PlannedUnits) -> String {
    let count = |units: &[UnitsAtHand]| {
        let each = units.iter().map(|units| format!("{} of {} {}", units.kept, units.total, units.what));
        each.collect::<Vec<_>>().join(", ")
    };
    match units {
        PlannedUnits::InterruptedRun { units } => {
            format!("resumes: {} kept from an interrupted run", count(units))
        }
        PlannedUnits::EarlierRuns { units } => format!("reuses: {} from earlier runs", count(units)),
    }
}
