//! The choice of the job that a claim starts.

/// The lanes in which the claim may start a job, without a look at their jobs.
macro_rules! open_lane {
    () => {
        "($5 = 0 or coalesce(busy.running, 0) < $5) \
         and not exists (select 1 from closed where closed.display in ('', lane.display))"
    };
}

/// The jobs of a lane that are due.
macro_rules! due_in_lane {
    () => {
        "from job where state = 'queued' and waiting_for = 0 \
         and priority = lane.priority and owner = lane.owner and display = lane.display and run_time_ms <= $4"
    };
}

/// Starts the next job: `$1` its lease, `$2` the end of the lease, `$3` the worker, `$4` now \[ms since 1970\], `$5` limit
/// on the running jobs of an owner, `$6` limit on those for a display (0: no limit), `$7` the worker's process.
///
/// It looks for the lowest priority with a due job, ranks the owners there, and looks at the lanes of the first of them
/// that has a due job. With a thousand lanes it so reads few jobs. The order of `turn` is a hint: PostgreSQL then looks at
/// one owner after the other, and ends at the first job. The order of the whole does not depend on it.
pub(super) const CLAIM: &str = concat!(
    "with busy as materialized ( \
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
     process = $7, start_time_ms = $4, progress = null, error = null, revision = revision + 1 \
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
