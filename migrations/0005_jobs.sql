-- The queue. A job's columns always agree with its state:
--
--     queued     waits: no lease, no end
--     running    one worker holds the lease (attempt, lease_id) until lease_until_ms
--     succeeded  has a result
--     failed     has an error; can be queued again by hand
--     cancelled  ended because somebody asked for it
create table job (
    id               text    not null primary key,
    -- the same request is the same job, however often it is sent
    request_id       text    not null unique check (length(request_id) between 1 and 128),
    display          text    not null references display (id),
    dataset          text    references dataset (id),
    spec             text    not null check (json_valid(spec)),
    state            text    not null check (state in ('queued', 'running', 'succeeded', 'failed', 'cancelled')),
    -- lower runs first
    priority         integer not null,
    -- claims so far; part of the fence
    attempt          integer not null default 0 check (attempt >= 0),
    -- failed attempts since the job last got ahead
    failures         integer not null default 0 check (failures >= 0),
    -- deaths of the server during an attempt, since the job last got ahead
    crashes          integer not null default 0 check (crashes >= 0),
    attempts_max     integer not null check (attempts_max >= 1),
    create_time_ms   integer not null,
    run_time_ms      integer not null,
    start_time_ms    integer,
    finish_time_ms   integer,
    lease_id         text,
    lease_until_ms   integer,
    worker           text,
    cancel_requested integer not null default 0 check (cancel_requested in (0, 1)),
    progress         text check (json_valid(progress)),
    error            text check (json_valid(error)),
    result           text check (json_valid(result)),
    -- digest of the latest checkpoint
    checkpoint       text,
    revision         integer not null default 1 check (revision >= 1),

    check ((state = 'running') = (lease_id is not null)),
    check ((state = 'running') = (lease_until_ms is not null)),
    check ((state = 'running') = (worker is not null)),
    check ((state in ('succeeded', 'failed', 'cancelled')) = (finish_time_ms is not null)),
    check ((state = 'succeeded') = (result is not null)),
    check (state <> 'failed' or error is not null),
    check (state <> 'queued' or cancel_requested = 0),
    check (state <> 'running' or attempt >= 1),
    check (checkpoint is null or state in ('queued', 'running', 'failed'))
) strict, without rowid;

-- What a claim takes from, in the order in which it takes.
create index job_to_claim on job (priority, run_time_ms, id) where state = 'queued';
create index job_leased on job (lease_until_ms) where state = 'running';
create index job_by_state on job (state, id);
create index job_by_display on job (display, id);
create index job_with_checkpoint on job (checkpoint) where checkpoint is not null;
create index job_by_dataset on job (dataset) where dataset is not null;

-- Ended means ended, except that a failed or cancelled job can be queued again.
create trigger succeeded_job_stays before update on job
when old.state = 'succeeded'
begin select raise(abort, 'the job has succeeded'); end;

-- What happened to a job, for people.
create table job_event (
    sequence integer primary key autoincrement,
    job      text    not null references job (id),
    time_ms  integer not null,
    attempt  integer not null check (attempt >= 0),
    message  text    not null
) strict;

create index job_event_by_job on job_event (job, sequence);
