-- The queue. The columns of a job always agree with its state:
--
--     queued     the job waits; it has no lease and no end
--     running    one worker holds the lease (attempt, lease_id) until lease_until_ms
--     succeeded  the job has a result
--     failed     the job has an error; a user can put it back into the queue
--     cancelled  the job ended because a user cancelled it
create table job (
    id               text collate "C" not null primary key,
    -- id chosen by the client: a repeated request of the same owner is the same job
    request_id       text collate "C" not null check (length(request_id) between 1 and 128),
    display          text collate "C" not null references display (id),
    -- first dataset that the job reads; a dataset may be deleted after the end of its jobs
    dataset          text collate "C",
    spec             text collate "C" not null check (json_valid(spec)),
    kind             text collate "C" not null check (kind = spec::json ->> 'kind'),
    -- what users find the job by, in small letters
    words            text collate "C" not null,
    state            text collate "C" not null check (state in ('queued', 'running', 'succeeded', 'failed', 'cancelled')),

    -- a job with a lower number runs first
    priority         bigint           not null,
    -- owner of the job, for fair turns; empty: unknown
    owner            text collate "C" not null default '' check (length(owner) <= 128),
    -- users list and watch the jobs of a batch together
    batch            text collate "C" check (length(batch) between 1 and 128),
    -- at most one queued or running job of an owner may have the key
    unique_key       text collate "C" check (length(unique_key) between 1 and 128),
    -- what the job is about, for people, such as the file name of its target
    label            text collate "C" check (length(label) between 1 and 128),
    -- requested earliest start, and requested time limit of an attempt
    not_before_ms    bigint,
    timeout_ms       bigint           check (timeout_ms > 0),
    -- ids of the jobs that must succeed before this job starts, as JSON, and the number of those that have not
    -- succeeded yet
    after            text collate "C" not null default '[]' check (json_valid(after)),
    waiting_for      bigint           not null default 0 check (waiting_for >= 0),
    -- labels that the process must have that runs the job, as JSON, ascending, each once
    needs            text collate "C" not null default '[]' check (json_valid(needs)),

    -- number of attempts started so far; with lease_id it fences off writes of workers that lost their lease
    attempt          bigint           not null default 0 check (attempt >= 0),
    attempts_max     bigint           not null check (attempts_max >= 1),
    -- memory and time of an attempt, estimated at the submit; 0: not estimated
    estimated_bytes  bigint           not null default 0 check (estimated_bytes >= 0),
    estimated_ms     bigint           not null default 0 check (estimated_ms >= 0),
    -- the estimated memory rounded up, so that jobs of about the same memory are in one lane
    counted_bytes    bigint           not null default 0 check (counted_bytes >= 0),
    -- failed attempts since the last checkpoint
    failures         bigint           not null default 0 check (failures >= 0),
    -- whether the server died while it ran the job, so that the job runs in a process of its own from now on
    suspect          bigint           not null default 0 check (suspect >= 0),
    -- deaths of that process since the last checkpoint
    crashes          bigint           not null default 0 check (crashes >= 0),
    lease_id         text collate "C",
    lease_until_ms   bigint,
    worker           text collate "C",
    -- process of the worker, where several share the database
    process          text collate "C",
    -- what computes, or computed, the latest attempt, for people: version of the program and kind of processor
    computer         text collate "C",
    cancel_requested bigint           not null default 0 check (cancel_requested in (0, 1)),

    create_time_ms   bigint           not null,
    -- earliest start of a queued job: the requested one, or the end of the pause after a failed attempt
    run_time_ms      bigint           not null,
    start_time_ms    bigint,
    finish_time_ms   bigint,

    progress         text collate "C" check (json_valid(progress)),
    error            text collate "C" check (json_valid(error)),
    result           text collate "C" check (json_valid(result)),
    -- digest of the latest checkpoint
    checkpoint       text collate "C",
    revision         bigint           not null default 1 check (revision >= 1),

    check ((state = 'running') = (lease_id is not null)),
    check ((state = 'running') = (lease_until_ms is not null)),
    check ((state = 'running') = (worker is not null)),
    check (state = 'running' or process is null),
    check ((state in ('succeeded', 'failed', 'cancelled')) = (finish_time_ms is not null)),
    check ((state = 'succeeded') = (result is not null)),
    check (state <> 'failed' or error is not null),
    check (state <> 'queued' or cancel_requested = 0),
    check (state <> 'running' or attempt >= 1),
    check (checkpoint is null or state in ('queued', 'running', 'failed'))
);

create index job_by_state on job (state, id);
create index job_by_display on job (display, id);
create index job_by_display_state on job (display, state, id);
create index job_by_dataset on job (dataset) where dataset is not null;
create index job_by_batch on job (batch, id) where batch is not null;
create index job_by_batch_state on job (batch, state, id) where batch is not null;
create index job_by_batch_display on job (batch, display, id) where batch is not null;
create index job_by_batch_display_state on job (batch, display, state, id) where batch is not null;
-- Searches for a kind, an owner or a text read this index from its end: some 200 bytes a job instead of the whole row.
create index job_to_search on job (id, state, display, batch, kind, owner, words);
create index job_by_owner_start on job (owner, start_time_ms) where start_time_ms is not null;
create index job_by_finish on job (finish_time_ms) where finish_time_ms is not null;
create index job_leased on job (lease_until_ms) where state = 'running';
create index job_with_checkpoint on job (checkpoint) where checkpoint is not null;
-- request ids and unique keys belong to their owner, so that no owner can block those of another or learn of them
create unique index job_by_request on job (owner, request_id);
create unique index job_unique on job (owner, unique_key)
where unique_key is not null and state in ('queued', 'running');
-- for the waiting time of the first due job of each kind, and the estimated work of all
create index job_due_by_kind on job (kind, run_time_ms, estimated_ms, needs) where state = 'queued' and waiting_for = 0;

-- A job that has succeeded never changes. A failed or cancelled job can be put back into the queue.
create trigger succeeded_job_stays before update on job for each row
when (old.state = 'succeeded')
execute function refuse('the job has succeeded');

-- Events in the history of a job, for people.
create table job_event (
    sequence bigint           generated by default as identity primary key,
    job      text collate "C" not null references job (id),
    time_ms  bigint           not null,
    attempt  bigint           not null check (attempt >= 0),
    message  text collate "C" not null
);

create index job_event_by_job on job_event (job, sequence);

-- Jobs that must succeed before a job starts, and have not succeeded yet. Only queued jobs wait.
create table job_dependency (
    job   text collate "C" not null references job (id),
    after text collate "C" not null references job (id),
    primary key (job, after)
);

create index job_dependency_by_after on job_dependency (after);

-- Artifacts that jobs read or made. With them, unreferenced artifacts are found without reading every job. The table
-- has no foreign key to artifact: the triggers below insert every text that looks like a digest, and a submit is
-- refused if an artifact is not stored. The digest of a dataset does not name an artifact.
create table job_artifact (
    job      text collate "C" not null references job (id),
    artifact text collate "C" not null,
    primary key (job, artifact)
);

create index job_artifact_by_artifact on job_artifact (artifact);

create function job_names_what_it_reads() returns trigger language plpgsql as $$
begin
    insert into job_artifact
    select distinct new.id, match[1] from regexp_matches(new.spec, '"(sha256-[0-9a-f]{64})"', 'g') as match
    on conflict do nothing;
    return null;
end $$;

create trigger job_names_what_it_reads after insert on job for each row
execute function job_names_what_it_reads();

create function job_names_what_it_made() returns trigger language plpgsql as $$
begin
    insert into job_artifact
    select distinct new.id, match[1]
    from regexp_matches(new.result, '(?<!"dataset_digest":)"(sha256-[0-9a-f]{64})"', 'g') as match
    on conflict do nothing;
    return null;
end $$;

create trigger job_names_what_it_made after update of result on job for each row
when (new.result is not null)
execute function job_names_what_it_made();

-- A lane is a priority, an owner, a display, a set of needs and a rounded memory. The job of a lane that has been due
-- longest runs first. So a claim looks at one job of every lane, no matter how many jobs wait.
create index job_to_claim on job (priority, owner, display, needs, counted_bytes, run_time_ms, id)
where state = 'queued' and waiting_for = 0;

create table lane (
    priority      bigint           not null,
    owner         text collate "C" not null,
    display       text collate "C" not null,
    needs         text collate "C" not null,
    counted_bytes bigint           not null,
    ready         bigint           not null check (ready >= 0),
    primary key (priority, owner, display, needs, counted_bytes)
);

create function job_enters_its_lane() returns trigger language plpgsql as $$
begin
    insert into lane values (new.priority, new.owner, new.display, new.needs, new.counted_bytes, 1)
    on conflict (priority, owner, display, needs, counted_bytes) do update set ready = lane.ready + 1;
    return null;
end $$;

create trigger job_enters_its_lane after insert on job for each row
when (new.state = 'queued' and new.waiting_for = 0)
execute function job_enters_its_lane();

create function job_gets_ready() returns trigger language plpgsql as $$
begin
    insert into lane values (new.priority, new.owner, new.display, new.needs, new.counted_bytes, 1)
    on conflict (priority, owner, display, needs, counted_bytes) do update set ready = lane.ready + 1;
    return null;
end $$;

create trigger job_gets_ready after update of state, waiting_for on job for each row
when (new.state = 'queued' and new.waiting_for = 0 and (old.state <> 'queued' or old.waiting_for > 0))
execute function job_gets_ready();

create function job_leaves_its_lane() returns trigger language plpgsql as $$
begin
    update lane set ready = ready - 1 where priority = old.priority and owner = old.owner and display = old.display
    and needs = old.needs and counted_bytes = old.counted_bytes;
    delete from lane where priority = old.priority and owner = old.owner and display = old.display
    and needs = old.needs and counted_bytes = old.counted_bytes and ready = 0;
    return null;
end $$;

create trigger job_leaves_its_lane after update of state, waiting_for on job for each row
when (old.state = 'queued' and old.waiting_for = 0 and (new.state <> 'queued' or new.waiting_for > 0))
execute function job_leaves_its_lane();

create function job_leaves_its_lane_for_good() returns trigger language plpgsql as $$
begin
    update lane set ready = ready - 1 where priority = old.priority and owner = old.owner and display = old.display
    and needs = old.needs and counted_bytes = old.counted_bytes;
    delete from lane where priority = old.priority and owner = old.owner and display = old.display
    and needs = old.needs and counted_bytes = old.counted_bytes and ready = 0;
    return null;
end $$;

create trigger job_leaves_its_lane_for_good after delete on job for each row
when (old.state = 'queued' and old.waiting_for = 0)
execute function job_leaves_its_lane_for_good();

-- The sets of needs that lanes have, but for the empty one. A claim compares these with the labels of its process.
create table lane_needs (
    needs text collate "C" not null primary key,
    lanes bigint           not null check (lanes >= 0)
);

create function lane_brings_its_needs() returns trigger language plpgsql as $$
begin
    insert into lane_needs values (new.needs, 1) on conflict (needs) do update set lanes = lane_needs.lanes + 1;
    return null;
end $$;

create trigger lane_brings_its_needs after insert on lane for each row
when (new.needs <> '[]')
execute function lane_brings_its_needs();

create function lane_takes_its_needs_along() returns trigger language plpgsql as $$
begin
    update lane_needs set lanes = lanes - 1 where needs = old.needs;
    delete from lane_needs where needs = old.needs and lanes = 0;
    return null;
end $$;

create trigger lane_takes_its_needs_along after delete on lane for each row
when (old.needs <> '[]')
execute function lane_takes_its_needs_along();

-- Numbers of jobs, kept up to date by the triggers below, so that no query must count them. No row has the number 0, so
-- owners without jobs take no space.
create table job_count (
    state text collate "C" not null,
    kind  text collate "C" not null,
    owner text collate "C" not null,
    jobs  bigint           not null check (jobs >= 0),
    primary key (state, kind, owner)
);

create function job_is_counted() returns trigger language plpgsql as $$
begin
    insert into job_count values (new.state, new.kind, new.owner, 1)
    on conflict (state, kind, owner) do update set jobs = job_count.jobs + 1;
    return null;
end $$;

create trigger job_is_counted after insert on job for each row
execute function job_is_counted();

create function job_is_counted_elsewhere() returns trigger language plpgsql as $$
begin
    update job_count set jobs = jobs - 1 where state = old.state and kind = old.kind and owner = old.owner;
    delete from job_count where state = old.state and kind = old.kind and owner = old.owner and jobs = 0;
    insert into job_count values (new.state, new.kind, new.owner, 1)
    on conflict (state, kind, owner) do update set jobs = job_count.jobs + 1;
    return null;
end $$;

create trigger job_is_counted_elsewhere after update of state on job for each row
when (old.state <> new.state)
execute function job_is_counted_elsewhere();

create function job_is_counted_no_more() returns trigger language plpgsql as $$
begin
    update job_count set jobs = jobs - 1 where state = old.state and kind = old.kind and owner = old.owner;
    delete from job_count where state = old.state and kind = old.kind and owner = old.owner and jobs = 0;
    return null;
end $$;

create trigger job_is_counted_no_more after delete on job for each row
execute function job_is_counted_no_more();

-- Pauses: no job for the display starts. Empty display: no job starts.
create table pause (
    display text collate "C" not null primary key,
    time_ms bigint           not null,
    reason  text collate "C" not null
);

create function display_takes_its_pause_along() returns trigger language plpgsql as $$
begin
    delete from pause where display = old.id;
    return null;
end $$;

create trigger display_takes_its_pause_along after delete on display for each row
execute function display_takes_its_pause_along();

-- The living processes, where several share the database. Each renews its row every few seconds.
create table process (
    -- identity of its data folder
    id            text collate "C" not null primary key,
    kind          text collate "C" not null check (kind in ('server', 'worker', 'both')),
    -- name of its workers, for people
    name          text collate "C" not null,
    version       text collate "C" not null,
    -- labels that its jobs may need, as JSON, and the largest estimated memory of its jobs; 0: it runs no jobs
    labels        text collate "C" not null check (json_valid(labels)),
    memory_bytes  bigint           not null check (memory_bytes >= 0),
    -- number of jobs that it runs at the same time
    workers       bigint           not null check (workers >= 0),
    start_time_ms bigint           not null,
    -- last sign of life
    seen_time_ms  bigint           not null
);
