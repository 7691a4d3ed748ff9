//! The display service.

use super::{from_wire, to_wire};
use crate::api::Api;
use crate::names;
use crate::pages::Page;
use lightpath_proto::v1;
use lightpath_proto::v1::display_service_server::DisplayService;
use lightpath_service::{Call, Field, ServiceError};
use tonic::{Request, Response, Status};

#[tonic::async_trait]
impl DisplayService for Api {
    async fn create_display(
        &self,
        request: Request<v1::CreateDisplayRequest>,
    ) -> Result<Response<v1::Display>, Status> {
        self.answer(request, Self::create_display).await
    }

    async fn get_display(&self, request: Request<v1::GetDisplayRequest>) -> Result<Response<v1::Display>, Status> {
        self.answer(request, Self::get_display).await
    }

    async fn list_displays(
        &self,
        request: Request<v1::ListDisplaysRequest>,
    ) -> Result<Response<v1::ListDisplaysResponse>, Status> {
        self.answer(request, Self::list_displays).await
    }

    async fn plan_propagation(
        &self,
        request: Request<v1::PlanPropagationRequest>,
    ) -> Result<Response<v1::PlanPropagationResponse>, Status> {
        self.answer(request, Self::plan_propagation).await
    }

    async fn delete_display(
        &self,
        request: Request<v1::DeleteDisplayRequest>,
    ) -> Result<Response<v1::DeleteDisplayResponse>, Status> {
        self.answer(request, Self::delete_display).await
    }
}

impl Api {
    async fn create_display(
        &self,
        call: &Call,
        request: v1::CreateDisplayRequest,
    ) -> Result<v1::Display, ServiceError> {
        let field = Field::new("display");
        let display = from_wire::display(call, field.required(request.display)?, &field)?;
        call.concerns(format!("displays/{}", display.id));
        let (display, create_time_ms) = self.service.displays.create(&display).await?;
        Ok(to_wire::display(display, create_time_ms))
    }

    async fn get_display(&self, call: &Call, request: v1::GetDisplayRequest) -> Result<v1::Display, ServiceError> {
        let id = names::display_id(call, &Field::new("name"), &request.name)?;
        let (display, create_time_ms) = self.store.display(&id).await?;
        Ok(to_wire::display(display, create_time_ms))
    }

    async fn list_displays(
        &self,
        call: &Call,
        request: v1::ListDisplaysRequest,
    ) -> Result<v1::ListDisplaysResponse, ServiceError> {
        let page = Page::new(&["displays"], request.page_size, &request.page_token)?;
        let displays = self.service.displays.visible(call, page.after.clone(), page.limit()).await?;
        let to_wire = |(display, time_ms)| to_wire::display(display, time_ms);
        let (displays, next_page_token) = page.fill(displays, |(display, _)| display.id.clone(), to_wire);
        Ok(v1::ListDisplaysResponse { displays, next_page_token })
    }

    async fn delete_display(
        &self,
        call: &Call,
        request: v1::DeleteDisplayRequest,
    ) -> Result<v1::DeleteDisplayResponse, ServiceError> {
        let id = names::display_id(call, &Field::new("name"), &request.name)?;
        call.concerns(format!("displays/{id}"));
        self.service.displays.delete(&id).await?;
        Ok(v1::DeleteDisplayResponse {})
    }
}
