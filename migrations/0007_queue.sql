-- Who jobs are for, what they wait for, and whose turn it is.

-- whose turn a job takes; empty: nobody said
alter table job add column owner text not null default '' check (length(owner) <= 128);
-- jobs that are looked at together
alter table job add column batch text check (length(batch) between 1 and 128);
-- at most one job with the same key waits or runs
alter table job add column unique_key text check (length(unique_key) between 1 and 128);
-- asked for: an earliest start, and a longest attempt
alter table job add column not_before_ms integer;
alter table job add column timeout_ms integer check (timeout_ms > 0);
-- ids of the jobs that must have succeeded first, as JSON, and how many of them have not
alter table job add column after text not null default '[]' check (json_valid(after));
alter table job add column waiting_for integer not null default 0 check (waiting_for >= 0);
alter table job add column kind text generated always as (spec ->> '$.kind') virtual;

create unique index job_unique on job (unique_key) where unique_key is not null and state in ('queued', 'running');
create index job_by_batch on job (batch, id) where batch is not null;
create index job_by_owner_start on job (owner, start_time_ms) where start_time_ms is not null;
create index job_by_display_state on job (display, state, id);

create table job_dependency (
    job   text not null references job (id),
    after text not null references job (id),
    primary key (job, after)
) strict, without rowid;

create index job_dependency_by_after on job_dependency (after);

-- A lane is a priority, an owner and a display. Within a lane the longest due job runs first, so that a claim looks at
-- one job of every lane, however many wait.
drop index job_to_claim;
create index job_to_claim on job (priority, owner, display, run_time_ms, id) where state = 'queued' and waiting_for = 0;

create table lane (
    priority integer not null,
    owner    text    not null,
    display  text    not null,
    ready    integer not null check (ready >= 0),
    primary key (priority, owner, display)
) strict, without rowid;

-- How many jobs there are, so that nobody has to count them.
create table job_count (
    state text    not null,
    kind  text    not null,
    owner text    not null,
    jobs  integer not null check (jobs >= 0),
    primary key (state, kind, owner)
) strict, without rowid;

insert into lane select priority, owner, display, count(*) from job
where state = 'queued' and waiting_for = 0 group by 1, 2, 3;
insert into job_count select state, kind, owner, count(*) from job group by 1, 2, 3;

create trigger job_is_counted after insert on job
begin
    insert into job_count values (new.state, new.kind, new.owner, 1)
    on conflict do update set jobs = jobs + 1;
end;

create trigger job_is_counted_elsewhere after update of state on job
when old.state <> new.state
begin
    update job_count set jobs = jobs - 1 where state = old.state and kind = old.kind and owner = old.owner;
    insert into job_count values (new.state, new.kind, new.owner, 1)
    on conflict do update set jobs = jobs + 1;
end;

create trigger job_is_counted_no_more after delete on job
begin
    update job_count set jobs = jobs - 1 where state = old.state and kind = old.kind and owner = old.owner;
end;

create trigger job_enters_its_lane after insert on job
when new.state = 'queued' and new.waiting_for = 0
begin
    insert into lane values (new.priority, new.owner, new.display, 1)
    on conflict do update set ready = ready + 1;
end;

create trigger job_gets_ready after update of state, waiting_for on job
when new.state = 'queued' and new.waiting_for = 0 and (old.state <> 'queued' or old.waiting_for > 0)
begin
    insert into lane values (new.priority, new.owner, new.display, 1)
    on conflict do update set ready = ready + 1;
end;

create trigger job_leaves_its_lane after update of state, waiting_for on job
when old.state = 'queued' and old.waiting_for = 0 and (new.state <> 'queued' or new.waiting_for > 0)
begin
    update lane set ready = ready - 1 where priority = old.priority and owner = old.owner and display = old.display;
    delete from lane where priority = old.priority and owner = old.owner and display = old.display and ready = 0;
end;

create trigger job_leaves_its_lane_for_good after delete on job
when old.state = 'queued' and old.waiting_for = 0
begin
    update lane set ready = ready - 1 where priority = old.priority and owner = old.owner and display = old.display;
    delete from lane where priority = old.priority and owner = old.owner and display = old.display and ready = 0;
end;

-- Nothing starts for this display; for an empty one, nothing at all.
create table pause (
    display text    not null primary key,
    time_ms integer not null,
    reason  text    not null
) strict, without rowid;
