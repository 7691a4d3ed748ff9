-- Webhooks: addresses that learn of ended jobs, kernels and rollouts.
create table webhook (
    id             text    not null primary key check (length(id) between 1 and 63),
    url            text    not null check (length(url) between 1 and 2048),
    -- events that it learns of, as JSON; empty: all
    events         text    not null check (json_valid(events)),
    -- null: it learns of all displays
    display        text    references display (id) on delete cascade,
    -- key that signs what is sent, as the receiver got it
    secret         text    not null,
    caller         text    not null,
    create_time_ms integer not null,
    -- grows with every change; a change of an older revision is refused
    revision       integer not null default 1 check (revision >= 1),
    -- where several processes share the database: the one that sends the events of this webhook, and until when no
    -- other process may send them
    teller         text,
    teller_until_ms integer
) strict, without rowid;

-- What webhooks are to learn, and what became of it. The triggers below insert rows in the transaction of the event, so
-- that no event is lost. A delivery that has ended stays for a while, for people.
create table webhook_delivery (
    sequence      integer primary key autoincrement,
    webhook       text    not null references webhook (id) on delete cascade,
    -- the same for every attempt, so that receivers recognize what they have already got
    id            text    not null unique default (lower(hex(randomblob(16)))) check (length(id) = 32),
    event         text    not null,
    -- what the event is about, as JSON for the receiver
    subject       text    not null check (json_valid(subject)),
    time_ms       integer not null,
    attempts      integer not null default 0 check (attempts >= 0),
    -- time of the next attempt; null: the delivery has ended
    next_time_ms  integer,
    -- whether the receiver has accepted it
    delivered     integer not null default 0 check (delivered in (0, 1)),
    -- what the receiver or the network answered to the latest attempt
    answer        text    not null default '',
    check (delivered = 0 or next_time_ms is null)
) strict;

create index webhook_delivery_due on webhook_delivery (webhook, next_time_ms) where next_time_ms is not null;
create index webhook_delivery_ended on webhook_delivery (webhook, sequence) where next_time_ms is null;
create index webhook_delivery_by_webhook on webhook_delivery (webhook, sequence);

create trigger job_end_is_told after update of state on job
when new.state <> old.state and new.state in ('succeeded', 'failed', 'cancelled')
begin
    insert into webhook_delivery (webhook, event, subject, time_ms, next_time_ms)
    select id, 'job.' || new.state, json_object(
        'job', 'jobs/' || new.id, 'display', 'displays/' || new.display, 'kind', new.kind, 'owner', new.owner,
        'batch', coalesce(new.batch, ''), 'attempt', new.attempt, 'error', coalesce(new.error ->> '$.message', '')
    ), new.finish_time_ms, new.finish_time_ms
    from webhook
    where coalesce(display, new.display) = new.display
    and (events = '[]' or exists (select 1 from json_each(events) where value = 'job.' || new.state));
end;

create trigger kernel_version_is_told after insert on kernel_version
begin
    insert into webhook_delivery (webhook, event, subject, time_ms, next_time_ms)
    select webhook.id, 'kernel.version_created', json_object(
        'kernel', kernel.name, 'version', new.version, 'model', new.model, 'digest', new.artifact
    ), new.create_time_ms, new.create_time_ms
    from webhook join kernel on kernel.id = new.kernel
    where coalesce(webhook.display, kernel.display) = kernel.display
    and (events = '[]' or exists (select 1 from json_each(events) where value = 'kernel.version_created'));
end;

create trigger kernel_move_is_told after insert on kernel_move
when new.alias = 'active'
begin
    insert into webhook_delivery (webhook, event, subject, time_ms, next_time_ms)
    select webhook.id, 'kernel.activated', json_object(
        'kernel', kernel.name, 'version', new.to_version, 'previousVersion', coalesce(new.from_version, 0),
        'generation', new.generation, 'caller', new.caller, 'reason', new.reason
    ), new.time_ms, new.time_ms
    from webhook join kernel on kernel.id = new.kernel
    where coalesce(webhook.display, kernel.display) = kernel.display
    and (events = '[]' or exists (select 1 from json_each(events) where value = 'kernel.activated'));
end;

create trigger rollout_end_is_told after update of state on rollout
when new.state <> old.state and new.state in ('completed', 'halted')
begin
    insert into webhook_delivery (webhook, event, subject, time_ms, next_time_ms)
    select webhook.id, 'rollout.' || new.state, json_object(
        'rollout', kernel.name || '/rollouts/' || new.number, 'kernel', kernel.name, 'version', new.version
    ), new.end_time_ms, new.end_time_ms
    from webhook join kernel on kernel.id = new.kernel
    where coalesce(webhook.display, kernel.display) = kernel.display
    and (events = '[]' or exists (select 1 from json_each(events) where value = 'rollout.' || new.state));
end;
