//! The choice of the job that a claim starts.

/// The sets of needs that a process has all labels for, of which one is among the labels that it starts jobs for, if it has
/// such; both as JSON.
macro_rules! met_needs {
    ($labels:literal, $only_for:literal) => {
        concat!(
            "met as materialized (select needs from lane_needs where not exists ( \
                select 1 from json_each(lane_needs.needs) need \
                where need.value not in (select label.value from json_each(",
            $labels,
            ") label)) and (",
            $only_for,
            " = '[]' or exists (select 1 from json_each(lane_needs.needs) need \
                where need.value in (select label.value from json_each(",
            $only_for,
            ") label))))"
        )
    };
}

/// The lanes whose jobs may be for a process, by the needs that it meets and the memory that it gives a job.
macro_rules! suitable_lane {
    ($memory:literal, $only_for:literal) => {
        concat!(
            "((lane.needs = '[]' and ",
            $only_for,
            " = '[]') or lane.needs in (select needs from met)) and lane.counted_bytes <= ",
            $memory
        )
    };
}

/// The jobs of a lane that wait.
macro_rules! ready_in_lane {
    () => {
        "from job where state = 'queued' and waiting_for = 0 \
         and priority = lane.priority and owner = lane.owner and display = lane.display and needs = lane.needs \
         and counted_bytes = lane.counted_bytes"
    };
}

/// The lanes in which the claim may start a job, without a look at their jobs.
macro_rules! open_lane {
    () => {
        concat!(
            suitable_lane!("$9", "$11"),
            " and ($5 = 0 or coalesce(busy.running, 0) < $5) \
         and not exists (select 1 from closed where closed.display in ('', lane.display))"
        )
    };
}

/// The jobs of a lane that are due.
macro_rules! due_in_lane {
    () => {
        concat!(ready_in_lane!(), " and run_time_ms <= $4")
    };
}

/// Starts the next job: `$1` its lease, `$2` the end of the lease, `$3` the worker, `$4` now \[ms since 1970\], `$5` limit
/// on the running jobs of an owner, `$6` limit on those for a display (0: no limit), `$7` the worker's process, `$8` its
/// labels as JSON, `$9` the memory that it gives a job \[bytes\], `$10` what computes there, `$11` the labels that it starts
/// jobs for as JSON.
///
/// It looks for the lowest priority with a due job, ranks the owners there, and looks at the lanes of the first of them
/// that has a due job. With a thousand lanes it so reads few jobs. The order of `turn` is a hint: PostgreSQL then looks at
/// one owner after the other, and ends at the first job. The order of the whole does not depend on it.
pub(super) const CLAIM: &str = concat!(
    "with ",
    met_needs!("$8", "$11"),
    ", busy as materialized ( \
        select owner, cast(sum(jobs) as bigint) as running from job_count where state = 'running' group by owner), \
     closed as materialized ( \
        select display from pause \
        union all \
        select display from job where $6 > 0 and state = 'running' group by display having count(*) >= $6), \
     turn as materialized ( \
        select here.priority, here.owner, coalesce(busy.running, 0) as running, \
            (select max(start_time_ms) from job where owner = here.owner and start_time_ms <= $4) as start_ms \
        from (select distinct priority, owner from lane where priority = ( \
            select lane.priority from lane left join busy on busy.owner = lane.owner where ",
    open_lane!(),
    " and exists (select 1 ",
    due_in_lane!(),
    ") order by lane.priority limit 1)) here \
        left join busy on busy.owner = here.owner) \
     update job set state = 'running', attempt = attempt + 1, lease_id = $1, lease_until_ms = $2, worker = $3, \
     process = $7, computer = $10, start_time_ms = $4, progress = null, error = null, revision = revision + 1 \
     where id = ( \
        select next.id from (select * from turn order by running, start_ms nulls first) turn \
        join job next on next.id = ( \
            select first.id from lane left join busy on busy.owner = lane.owner \
            join job first on first.id = (select id ",
    due_in_lane!(),
    " order by run_time_ms, id limit 1) \
            where lane.priority = turn.priority and lane.owner = turn.owner and ",
    open_lane!(),
    " order by first.run_time_ms, first.id limit 1) \
        order by turn.running, turn.start_ms nulls first, next.run_time_ms, next.id limit 1) \
     returning *"
);

/// The earliest time after `$1` \[ms since 1970\] when a waiting job becomes due that a process with the labels `$2` (JSON)
/// and the memory `$3` for a job \[bytes\] can run, and starts jobs for the labels `$4` (JSON).
pub(super) const NEXT_RUN_TIME: &str = concat!(
    "with ",
    met_needs!("$2", "$4"),
    " select min((select min(run_time_ms) ",
    ready_in_lane!(),
    " and run_time_ms > $1)) from lane where ",
    suitable_lane!("$3", "$4")
);
